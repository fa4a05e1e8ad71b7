"""Noise of the measurement, errors of camera and mesh, and the evidence of data at rest."""
