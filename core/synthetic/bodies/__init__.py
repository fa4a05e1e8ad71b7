"""Bodies of the virtual bench that are no blocks: their surfaces, meshes and pushes."""
