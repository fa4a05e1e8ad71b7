"""A store of made datasets, so that one which is needed again is not made again."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.foundation.source_digest import source_digest

if TYPE_CHECKING:
    from palpate.synthetic import Scenario, Truth

__all__ = ["BENCH", "place_of", "stored_dataset"]

BENCH = ("foundation", "mesh", "setup", "synthetic")
"""Folders of `core` that the virtual bench imports."""


def place_of(store: Path, name: str, scenario: Scenario, seed: int) -> Path:
    """Return the folder of a dataset: another one for each bench, scenario and seed."""
    text = f"{scenario!r} {seed} {source_digest(*BENCH)}"
    return store / hashlib.sha256(text.encode()).hexdigest()[:16] / name


def stored_dataset(store: Path, name: str, scenario: Scenario, seed: int) -> tuple[Path, Truth]:
    """Return the folder of a dataset, which is made if it is missing, and its truth.

    Args:
        store: folder of all datasets; made if it is missing.
        name: of the dataset.
        scenario: to be made.
        seed: of everything random.
    """
    from palpate.synthetic import make_dataset, read_truth

    folder = place_of(store, name, scenario, seed)
    if folder.is_dir():
        return folder, read_truth(folder, scenario)
    folder.parent.mkdir(parents=True, exist_ok=True)
    return folder, make_dataset(folder, scenario, seed)
