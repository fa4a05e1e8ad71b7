"""Replays in a form that can be stored and shown: whole runs, single frames, and
interactive ones.
"""
