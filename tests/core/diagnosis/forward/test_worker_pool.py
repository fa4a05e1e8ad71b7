from __future__ import annotations

import os
from pathlib import Path

from palpate.diagnosis.forward import worker_pool as workers
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.observation.frame_groups import Observations


def _read(names: tuple[str, ...], home: Path) -> tuple[int, list[int], int]:
    """The process, the frames of each of these sequences, and how many sequences the process
    keeps."""
    frames = [len(workers._measured(home / f"{name}.pickle").times) for name in names]
    return os.getpid(), frames, len(workers._READ)


def _item(name: str, frames: int) -> Observations:
    return Observations(name, [0.0] * frames, None, ())  # type: ignore[arg-type]


def test_other_measurements_are_held_by_the_same_process_which_forgets_the_old_ones():
    with Workers([_item("poke-01", 3), _item("drag-01", 5)], 1) as pool:
        old = pool._home
        first, before, kept = pool.run(_read, ("poke-01", "drag-01"), old).result()
        pool.hold([_item("poke-01", 4)])
        second, after, left = pool.run(_read, ("poke-01",), pool._home).result()
        _, again, _ = pool.run(_read, ("drag-01",), old).result()  # as what was begun before would
    assert before == [3, 5] and kept == 2
    assert after == [4] and left == 1
    assert again == [5]
    assert first == second
    assert not old.exists()


def test_processes_that_were_started_ahead_are_those_that_work():
    with Workers([], 2) as pool:
        pool.start()
        started = set(pool._pool._processes)
        process, _, _ = pool.run(_read, (), pool._home).result()
    assert len(started) == 2 and process in started
