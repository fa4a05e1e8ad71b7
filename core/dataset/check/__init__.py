"""Check of a dataset: its summary, warnings, and missing motions."""

from palpate.dataset.check.dataset_summary import DatasetSummary, check_dataset

__all__ = ["DatasetSummary", "check_dataset"]
