"""Many parameter sets of one motion: each from nothing, each from the one before, and in two processes at once."""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
from rich.table import Table

from benchmarks.reference import SETUP
from benchmarks.stopwatch import timed
from core.frames import FloatArray
from core.mesh import GridSpec
from core.replay import Equilibrium, replay, require_converged
from core.setup import Material, Setup, Tool

__all__ = ["run"]

SETS = (1, 4, 16)
GRID = GridSpec(nodes=(15, 11, 9), spacing=1.2e-3)
SAME = 2e-6
"""How well [m] the ways must agree in every node."""


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


def run() -> list[Table]:
    """Replay more and more sets in each way; all must find the same."""
    table = Table(
        "sets",
        "alone, CPU s a set",
        "chained, CPU s a set",
        "two processes, s a set",
        title="A poke of 12 frames, many parameter sets",
    )
    _alone(_setups(1))  # warms up
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(_worker, [_setups(1)] * 2))
        for count in SETS:
            setups = _setups(count)
            alone, apart = timed(lambda setups=setups: _shapes(_alone(setups)))  # type: ignore[misc]
            chained, together = timed(lambda setups=setups: _shapes(_chained(setups)))  # type: ignore[misc]
            begin = time.perf_counter()
            halves = [part for part in (setups[: (count + 1) // 2], setups[(count + 1) // 2 :]) if part]
            split = np.concatenate(list(pool.map(_worker, halves)))
            both = time.perf_counter() - begin
            apart_by = float(max(np.abs(chained - alone).max(), np.abs(split - alone).max()))
            if apart_by > SAME:
                raise RuntimeError(f"{count} sets differ with the way they are replayed by {1e6 * apart_by:.1f} um")
            table.add_row(str(count), f"{apart / count:.2f}", f"{together / count:.2f}", f"{both / count:.2f}")
    return [table]
