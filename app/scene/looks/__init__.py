"""Scenes of first looks: clouds by the reason of each point, tool, path and stated surface."""
