"""Meshers that fill closed surfaces with tetrahedra."""
