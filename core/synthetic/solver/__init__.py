"""Finite elements of the virtual bench: quadratic tetrahedra, independent of `palpate.fem`."""
