"""Virtual datasets that tests share: made once for all workers and runs, then copied.

The store is below pytest's cache folder. The name of an entry is a digest of the scenario, the
seed and the sources of the virtual bench, so that a change of one of them makes the dataset anew.
"""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

from filelock import FileLock

from palpate.blind.dataset_store import BENCH
from palpate.foundation.source_digest import source_digest
from palpate.synthetic import Scenario, make_dataset, truth_path

__all__ = ["copy_dataset"]

STORE = Path(__file__).parents[1] / ".pytest_cache" / "made-datasets"


def copy_dataset(folder: Path, scenario: Scenario, seed: int) -> None:
    """Put the dataset of a scenario and seed at `folder`, with its truth beside it."""
    text = f"{scenario!r} {seed} {source_digest(*BENCH)}"
    made = STORE / hashlib.sha256(text.encode()).hexdigest()[:16] / folder.name
    made.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{made.parent}.lock"):
        if not made.is_dir():
            make_dataset(made, scenario, seed)
    folder.parent.mkdir(parents=True, exist_ok=True)
    shutil.copytree(made, folder)
    shutil.copy(truth_path(made), truth_path(folder))
