"""Virtual datasets that tests share: made once for all workers and runs, then copied.

The store is below pytest's cache folder.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from filelock import FileLock

from palpate.blind.dataset_store import place_of, stored_dataset
from palpate.synthetic import Scenario, truth_path

__all__ = ["copy_dataset"]

STORE = Path(__file__).parents[1] / ".pytest_cache" / "made-datasets"


def copy_dataset(folder: Path, scenario: Scenario, seed: int) -> None:
    """Put the dataset of a scenario and seed at `folder`, with its truth beside it."""
    place = place_of(STORE, folder.name, scenario, seed).parent
    place.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{place}.lock"):
        made, _ = stored_dataset(STORE, folder.name, scenario, seed)
    folder.parent.mkdir(parents=True, exist_ok=True)
    shutil.copytree(made, folder)
    shutil.copy(truth_path(made), truth_path(folder))
