"""Reduction of clouds: segmentation, camera model, drift of the phantom, distances to surfaces."""
