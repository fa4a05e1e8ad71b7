"""Tables of numbers: dialects, meaning of columns, units and rotations, depth steps, previews."""
