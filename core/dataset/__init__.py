"""Measured data: a folder in, a checked and lazy Dataset out."""

from core.dataset.folder import Dataset, Touches, open_dataset
from core.dataset.schema import DatasetConfig
from core.dataset.sequence import Forces, Kinematics, Sequence

__all__ = ["Dataset", "DatasetConfig", "Forces", "Kinematics", "Sequence", "Touches", "open_dataset"]
