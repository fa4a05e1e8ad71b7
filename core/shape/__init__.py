"""Bodies that are no block: closed surfaces, checked, filled with tetrahedra."""
