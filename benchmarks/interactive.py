"""Rate of interactive replay with a tool that is moved by hand; answers are checked, then timed."""

from __future__ import annotations

import time

import numpy as np
from rich.table import Table

from benchmarks.reference_pokes import SETUP
from palpate.effects.elastic_material import StiffInclusion
from palpate.fem.newton import MAX_PENETRATION
from palpate.foundation.arrays import FloatArray
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.interactive import InteractiveFrame, InteractiveReplay

__all__ = ["run"]

ANSWERS, RATE, TARGET = 240, 30.0, 20.0
"""Number of requested positions, positions per second of motion, target rate of answers [1/s]."""


def hand(depth: float) -> FloatArray:
    """Return tool centres (n, 3) [m] of eight seconds of motion.

    The tool moves up and down to a depth [m], and over the top at up to 60 mm/s.
    """
    t = np.arange(ANSWERS) / RATE
    x, y = 0.02 * np.sin(2 * np.pi * 0.45 * t), 0.008 * np.sin(2 * np.pi * 0.7 * t)
    z = (
        SETUP.geometry.size[2]
        + SETUP.tool.radius
        - depth * (0.5 - 0.5 * np.cos(2 * np.pi * 0.5 * t))
    )
    return np.column_stack([x, y, z])


def answers(
    live: InteractiveReplay, places: FloatArray
) -> tuple[list[InteractiveFrame], FloatArray, FloatArray]:
    """Return the answer at each place, and its CPU time and wall time (n,) [s]."""
    frames, busy, wall = [], [], []
    live.at(places[0] + np.array([0.0, 0.0, 0.02]))
    # The first touch computes the factorisation that all others share.
    live.at(places[0] - np.array([0.0, 0.0, 1e-3]))
    for place in places:
        before, began = time.process_time(), time.perf_counter()
        frames.append(live.at(place))
        busy.append(time.process_time() - before)
        wall.append(time.perf_counter() - began)
    return frames, np.array(busy), np.array(wall)


def check(frames: list[InteractiveFrame], places: FloatArray, radius: float) -> None:
    """Raise RuntimeError unless all answers are equilibria at the requested places.

    No point of the surface may be inside the tool.
    """
    for number, (one, place) in enumerate(zip(frames, places, strict=True)):
        if not one.converged:
            raise RuntimeError(f"place {number}: {one.outcome}")
        if np.linalg.norm(one.tool - place) > 1e-9:
            raise RuntimeError(f"place {number}: the tool is at {one.tool}, expected {place}")
        inside = radius - float(np.linalg.norm(one.surface - one.tool, axis=1).min())
        if inside > MAX_PENETRATION:
            raise RuntimeError(
                f"place {number}: a point of the surface lies {inside * 1e3:.2f} mm in the tool"
            )


def run() -> list[Table]:
    """Measure the stated block and one with a lump.

    Raises RuntimeError where an answer is wrong or the rate is below the target.
    """
    lump = StiffInclusion(x=0.01, y=0.0, z=0.026, radius=7e-3, stiffness_ratio=8.0)
    columns = (
        "model",
        "deepest, mm",
        "answers",
        "median, ms",
        "95 %, ms",
        "answers a second",
        "per CPU second",
    )
    table = Table(*columns, title="interactive replay: a tool moved by hand")
    for name, setup in (("stated", SETUP), ("with a stiff lump", lump.apply(SETUP))):
        for depth in (4e-3, 8e-3):
            places = hand(depth)
            frames, busy, wall = answers(
                InteractiveReplay(setup, PAGE_GRID.for_tool(setup.tool.radius)), places
            )
            check(frames, places, setup.tool.radius)
            rate, pure = len(wall) / wall.sum(), len(busy) / busy.sum()
            spans = [f"{1e3 * value:.0f}" for value in (np.median(wall), np.quantile(wall, 0.95))]
            table.add_row(
                name, f"{depth * 1e3:.0f}", str(len(frames)), *spans, f"{rate:.0f}", f"{pure:.0f}"
            )
            if pure < TARGET:
                raise RuntimeError(
                    f"{name}, {depth * 1e3:.0f} mm: {pure:.0f} answers per CPU second; "
                    f"expected {TARGET:.0f}"
                )
    return [table]
