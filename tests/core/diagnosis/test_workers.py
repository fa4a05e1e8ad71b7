from __future__ import annotations

import os

from core.diagnosis import workers
from core.diagnosis.observations import Observations
from core.diagnosis.workers import Workers


def _held(names: tuple[str, ...]) -> tuple[int, list[float]]:
    """The process, and how many frames it holds of each of these sequences; -1 of one it does not know."""
    data = workers._DATA
    return os.getpid(), [len(data[name].times) if name in data else -1 for name in names]


def _item(name: str, frames: int) -> Observations:
    return Observations(name, [0.0] * frames, None, ())  # type: ignore[arg-type]


def test_other_measurements_are_held_by_new_processes_alone():
    names = ("poke-01", "drag-01")
    with Workers([_item("poke-01", 3), _item("drag-01", 5)], 1) as pool:
        first, before = pool.run(_held, names).result()
        pool.hold([_item("poke-01", 4)])
        second, after = pool.run(_held, names).result()
    assert before == [3, 5] and after == [4, -1]
    assert first != second
