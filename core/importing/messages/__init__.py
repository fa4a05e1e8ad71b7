"""Decoding of robot messages into arrays."""
