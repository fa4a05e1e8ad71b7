"""Materials that remember: where their state is stored, and the stress that comes of it."""
