"""Many parameter sets of one motion: each from nothing, each from the one before, in two processes at once, and as one batch."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import torch
from rich.table import Table

from benchmarks.reference import SETUP
from benchmarks.stopwatch import timed
from core.batch import replay_batch
from core.frames import FloatArray
from core.mesh import GridSpec
from core.replay import Equilibrium, replay, require_converged
from core.setup import Material, Setup, Tool

__all__ = ["run"]

SETS = (1, 4, 16)
GRID = GridSpec(nodes=(15, 11, 9), spacing=1.2e-3)
SAME = 2e-6
"""How well [m] the ways must agree in every node."""
CARD_SETS = (16, 64, 256)
"""More than a card can hold are done in parts."""


def _way() -> FloatArray:
    """A poke by 6 mm at one side of the middle, 0.5 mm a frame."""
    top = SETUP.geometry.size[2] + SETUP.tool.radius
    return np.array([[8e-3, 4e-3, top - depth] for depth in np.arange(0.5e-3, 6.1e-3, 0.5e-3)])


def _setups(count: int) -> list[Setup]:
    """Radii from 4.5 to 5.5 mm, and Poisson's ratios from 0.40 to 0.48 in turn."""
    return [
        replace(SETUP, tool=Tool(radius=4.5e-3 + 1e-3 * share), material=Material(poisson_ratio=0.4 + 0.08 * share))
        for share in np.linspace(0, 1, count)
    ]


def _alone(setups: list[Setup]) -> list[list[Equilibrium]]:
    return [replay(setup, _way(), GRID) for setup in setups]


def _chained(setups: list[Setup]) -> list[list[Equilibrium]]:
    """Each set begins, frame by frame, where the one before it ended."""
    found: list[list[Equilibrium]] = []
    for setup in setups:
        found.append(replay(setup, _way(), GRID, starts=found[-1] if found else None))
    return found


def _shapes(sets: list[list[Equilibrium]]) -> FloatArray:
    for frames in sets:
        require_converged(frames)
    return np.stack([frame.displacement for frames in sets for frame in frames])


def _worker(setups: list[Setup]) -> FloatArray:
    return _shapes(_chained(setups))


def _clocked(work: Callable[[], FloatArray]) -> tuple[FloatArray, float]:
    """What the work returns, and the seconds on the wall; work on a card has ended when its shapes are here."""
    begin = time.perf_counter()
    result = work()
    return result, time.perf_counter() - begin


def _check(count: int, *ways: FloatArray) -> None:
    """All ways of replaying so many sets must find the same."""
    apart = max(float(np.abs(way - ways[0]).max()) for way in ways)
    if apart > SAME:
        raise RuntimeError(f"{count} sets differ with the way they are replayed by {1e6 * apart:.1f} um")


def _on_card() -> list[Table]:
    """A batch on CUDA against single replays, every eighth of which is checked; nothing where there is no card."""
    if not torch.cuda.is_available():
        return []
    name = torch.cuda.get_device_name()
    table = Table("sets", "alone, CPU s a set", "batch on CUDA, s a set", title=f"The same on {name}")
    _shapes(replay_batch(_setups(2), _way(), GRID, device="cuda"))  # warms up
    for count in CARD_SETS:
        setups, frames = _setups(count), len(_way())
        alone, apart = timed(lambda setups=setups: _shapes(_alone(setups[::8])))  # type: ignore[misc]
        batch, together = _clocked(lambda setups=setups: _shapes(replay_batch(setups, _way(), GRID, device="cuda")))  # type: ignore[misc]
        _check(count, alone, batch.reshape(count, frames, *batch.shape[1:])[::8].reshape(alone.shape))
        table.add_row(str(count), f"{apart / len(setups[::8]):.3f}", f"{together / count:.3f}")
    return [table]


def run() -> list[Table]:
    """Replay more and more sets in each way; all must find the same."""
    table = Table(
        "sets",
        "alone, CPU s a set",
        "chained, CPU s a set",
        "two processes, s a set",
        "batch, CPU s a set",
        title="A poke of 12 frames, many parameter sets",
    )
    _alone(_setups(1))  # warms up
    replay_batch(_setups(1), _way(), GRID)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(_worker, [_setups(1)] * 2))
        for count in SETS:
            setups = _setups(count)
            alone, apart = timed(lambda setups=setups: _shapes(_alone(setups)))  # type: ignore[misc]
            chained, together = timed(lambda setups=setups: _shapes(_chained(setups)))  # type: ignore[misc]
            batch, at_once = timed(lambda setups=setups: _shapes(replay_batch(setups, _way(), GRID)))  # type: ignore[misc]
            halves = [part for part in (setups[: (count + 1) // 2], setups[(count + 1) // 2 :]) if part]
            split, both = _clocked(lambda halves=halves: np.concatenate(list(pool.map(_worker, halves))))  # type: ignore[misc]
            _check(count, alone, chained, split, batch)
            table.add_row(str(count), *(f"{seconds / count:.2f}" for seconds in (apart, together, both, at_once)))
    return [table, *_on_card()]
