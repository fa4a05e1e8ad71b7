"""Robot to phantom: from touches of landmarks, with their pairing and repair."""
