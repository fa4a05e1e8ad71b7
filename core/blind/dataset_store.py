"""A store of the datasets of blind cases, so that a suite which is diagnosed again makes none."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.blind.cases import Case, scenario_of
from palpate.foundation.source_digest import source_digest

if TYPE_CHECKING:
    from palpate.synthetic import Truth

__all__ = ["BENCH", "place_of", "stored_dataset"]

BENCH = ("foundation", "mesh", "setup", "synthetic")
"""Folders of `core` that the virtual bench imports."""


def place_of(store: Path, case: Case) -> Path:
    """Return the folder of a case's dataset: another one for each bench, scenario and seed."""
    text = f"{scenario_of(case)!r} {case.seed} {source_digest(*BENCH)}"
    return store / f"{case.name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def stored_dataset(store: Path, case: Case) -> tuple[Path, Truth]:
    """Return the folder of a case's dataset, made if it is missing, and its truth.

    Args:
        store: folder of all datasets; made if it is missing.
        case: to be made.
    """
    from palpate.synthetic import make_dataset, read_truth

    scenario, folder = scenario_of(case), place_of(store, case)
    if folder.is_dir():
        return folder, read_truth(folder, scenario)
    store.mkdir(parents=True, exist_ok=True)
    return folder, make_dataset(folder, scenario, case.seed)
