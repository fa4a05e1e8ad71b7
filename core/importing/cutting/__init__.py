"""Cutting of recordings: pushes by kind, rest clouds, touches and splits."""
