"""Measured data: a folder in, a checked and lazy Dataset out."""

from palpate.dataset.folder import Dataset, Touches, open_dataset
from palpate.dataset.schema import DatasetConfig
from palpate.dataset.sequence import Forces, Kinematics, Sequence

__all__ = [
    "Dataset",
    "DatasetConfig",
    "Forces",
    "Kinematics",
    "Sequence",
    "Touches",
    "open_dataset",
]
