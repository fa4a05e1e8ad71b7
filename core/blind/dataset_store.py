"""A store of made datasets, so that one which is needed again is not made again."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.foundation.source_digest import source_digest

if TYPE_CHECKING:
    from palpate.synthetic import Scenario, ShapeScenario, Truth

__all__ = ["BENCH", "make_drawn", "place_of", "scenario_in", "stored_dataset"]

BENCH = ("foundation", "mesh", "setup", "synthetic")
"""Folders of `core` that the virtual bench imports."""


def place_of(store: Path, name: str, scenario: Scenario | ShapeScenario, seed: int) -> Path:
    """Return the folder of a dataset: another one for each bench, scenario and seed."""
    text = f"{scenario!r} {seed} {source_digest(*BENCH)}"
    return store / hashlib.sha256(text.encode()).hexdigest()[:16] / name


def scenario_in(drawn: Scenario | ShapeScenario) -> Scenario:
    """Beliefs and hidden effects of a case on a block or on another shape."""
    from palpate.synthetic import ShapeScenario

    return drawn.scenario if isinstance(drawn, ShapeScenario) else drawn


def make_drawn(folder: Path, drawn: Scenario | ShapeScenario, seed: int) -> Truth:
    """Make the dataset `folder` of a block or of another shape."""
    from palpate.synthetic import ShapeScenario, make_dataset, make_shape_dataset

    if isinstance(drawn, ShapeScenario):
        return make_shape_dataset(folder, drawn, seed)
    return make_dataset(folder, drawn, seed)


def stored_dataset(
    store: Path, name: str, scenario: Scenario | ShapeScenario, seed: int
) -> tuple[Path, Truth]:
    """Return the folder of a dataset, which is made if it is missing, and its truth.

    Args:
        store: folder of all datasets; made if it is missing.
        name: of the dataset.
        scenario: to be made.
        seed: of everything random.
    """
    from palpate.synthetic import read_truth

    folder = place_of(store, name, scenario, seed)
    if folder.is_dir():
        return folder, read_truth(folder, scenario_in(scenario))
    folder.parent.mkdir(parents=True, exist_ok=True)
    return folder, make_drawn(folder, scenario, seed)
