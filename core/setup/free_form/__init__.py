"""Bodies of any shape: closed surfaces, what is held of them, and their free surface."""
