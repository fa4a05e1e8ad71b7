"""Measured data: a dataset folder is checked and read into a `Dataset`, clouds on demand.

`folder` opens a dataset, `schema` and `sequence` read its files, `check` sums it up, and
`dataset_problems` lists everything that is wrong with it.
"""

from palpate.dataset.contact_points import Touches, Traces
from palpate.dataset.folder import Dataset, open_dataset
from palpate.dataset.schema import DatasetConfig
from palpate.dataset.sequence import Forces, Kinematics, Sequence

__all__ = [
    "Dataset",
    "DatasetConfig",
    "Forces",
    "Kinematics",
    "Sequence",
    "Touches",
    "Traces",
    "open_dataset",
]
