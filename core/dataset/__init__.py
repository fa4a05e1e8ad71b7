"""Measured data: a folder in, a checked and lazy Dataset out."""

from core.dataset.folder import Dataset, Forces, Kinematics, Sequence, Touches, open_dataset
from core.dataset.schema import DatasetConfig

__all__ = ["Dataset", "DatasetConfig", "Forces", "Kinematics", "Sequence", "Touches", "open_dataset"]
