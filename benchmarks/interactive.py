"""A tool led by hand: how many answers a second a block gives, checked first, then timed."""

from __future__ import annotations

import time

import numpy as np
from rich.table import Table

from benchmarks.reference_pokes import SETUP
from palpate.effects import effect_named
from palpate.fem.newton import MAX_PENETRATION
from palpate.foundation.arrays import FloatArray
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.interactive import InteractiveFrame, InteractiveReplay

__all__ = ["run"]

ANSWERS, RATE, WANTED = 240, 30.0, 20.0
"""Places asked for, how many of them a hand passes in a second, and how many answers a second are
wanted."""


def hand(depth: float) -> FloatArray:
    """Centres (n, 3) [m] of eight seconds: up and down to a depth [m], to and fro over the top at
    up to 60 mm/s.
    """
    t = np.arange(ANSWERS) / RATE
    x, y = 0.02 * np.sin(2 * np.pi * 0.45 * t), 0.008 * np.sin(2 * np.pi * 0.7 * t)
    z = (
        SETUP.geometry.size[2]
        + SETUP.tool.radius
        - depth * (0.5 - 0.5 * np.cos(2 * np.pi * 0.5 * t))
    )
    return np.column_stack([x, y, z])


def answers(live: InteractiveReplay, places: FloatArray) -> tuple[list[InteractiveFrame], FloatArray, FloatArray]:
    """What was felt at each place, and how long it took (n,) [s]: of the processor, and on the
    wall.
    """
    felt, busy, wall = [], [], []
    live.at(places[0] + np.array([0.0, 0.0, 0.02]))
    live.at(
        places[0] - np.array([0.0, 0.0, 1e-3])
    )  # the first touch factorises what all others share
    for place in places:
        before, began = time.process_time(), time.perf_counter()
        felt.append(live.at(place))
        busy.append(time.process_time() - before)
        wall.append(time.perf_counter() - began)
    return felt, np.array(busy), np.array(wall)


def check(felt: list[InteractiveFrame], places: FloatArray, radius: float) -> None:
    """RuntimeError unless all are equilibria at the places asked for, with no point of the surface
    in the tool.
    """
    for number, (one, place) in enumerate(zip(felt, places, strict=True)):
        if not one.converged:
            raise RuntimeError(f"place {number}: {one.outcome}")
        if np.linalg.norm(one.tool - place) > 1e-9:
            raise RuntimeError(f"place {number}: the tool is at {one.tool}, asked for was {place}")
        inside = radius - float(np.linalg.norm(one.surface - one.tool, axis=1).min())
        if inside > MAX_PENETRATION:
            raise RuntimeError(
                f"place {number}: a point of the surface lies {inside * 1e3:.2f} mm in the tool"
            )


def run() -> list[Table]:
    """Answers a second of the stated block and of one with a lump; RuntimeError where one is wrong
    or they are too few.
    """
    lump = effect_named("stiff_inclusion")(x=0.01, y=0.0, z=0.026, radius=7e-3, stiffness_ratio=8.0)  # type: ignore[call-arg]
    columns = (
        "model",
        "deepest, mm",
        "answers",
        "median, ms",
        "95 %, ms",
        "answers a second",
        "by the processor's clock",
    )
    table = Table(*columns, title="live: a tool led by hand")
    for name, setup in (("stated", SETUP), ("with a stiff lump", lump.apply(SETUP))):
        for depth in (4e-3, 8e-3):
            places = hand(depth)
            felt, busy, wall = answers(InteractiveReplay(setup, PAGE_GRID.for_tool(setup.tool.radius)), places)
            check(felt, places, setup.tool.radius)
            rate, pure = len(wall) / wall.sum(), len(busy) / busy.sum()
            spans = [f"{1e3 * value:.0f}" for value in (np.median(wall), np.quantile(wall, 0.95))]
            table.add_row(
                name, f"{depth * 1e3:.0f}", str(len(felt)), *spans, f"{rate:.0f}", f"{pure:.0f}"
            )
            if pure < WANTED:
                raise RuntimeError(
                    f"{name}, {depth * 1e3:.0f} mm: {pure:.0f} answers a second of processor time, wanted are {WANTED:.0f}"
                )
    return [table]
