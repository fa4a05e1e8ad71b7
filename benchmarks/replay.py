"""Replays of a minute of palpation, beside what other engines took for the same block.

The problem: 68.7 x 39.3 x 35.8 mm, base held, E 5 kPa, nu 0.45, a frictionless ball of 5 mm driven by position; four pokes
into the top by 4 to 10 mm, a push from the side and a drag, at 30 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.table import Table

from benchmarks.stopwatch import timed
from core.frames import FloatArray
from core.mesh import GridSpec
from core.replay import Equilibrium, replay, require_converged
from core.setup import Box, Setup, Tool

__all__ = ["run"]

RATE = 30.0
SETUP = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=5e-3), mass=0.104)
OTHERS = {
    "SOFA, corotational tetrahedra, 200 steps a frame": ("8.5", "52"),
    "SOFA, best found (preconditioned CG, 4 steps)": ("0.10", "2.8"),
    "MuJoCo 4 flex": ("0.63 - 0.94", "6.9"),
    "Newton 1.8 VBD": ("2.8", "11"),
    "linear tetrahedra, full Newton": ("0.19", "2.5"),
}
"""CPU seconds per simulated second on 13x5x5 and 25x9x9 nodes, one thread, measured once; ratios below 1.5 mean nothing."""


@dataclass(frozen=True)
class Case:
    """One grid, the seconds of the motion it replays, and the force of a 4 mm poke [N] it must give (relative tolerance)."""

    name: str
    grid: GridSpec
    start: float
    stop: float
    force: float
    tolerance: float


CASES = (
    Case("13x5x5", GridSpec(nodes=(13, 5, 5)), 0.0, 60.0, 0.1788, 0.01),
    Case("25x9x9", GridSpec(nodes=(25, 9, 9)), 2.0, 6.0, 0.1762, 0.01),
    Case("17x13x10, 1 mm at tool", GridSpec(nodes=(17, 13, 10), spacing=1e-3), 2.0, 6.0, 0.1425, 0.05),
)


def motion() -> FloatArray:
    """Tool centres (1800, 3) [m] of a minute: four pokes, a side push and a drag, ten seconds each, eight in touch."""
    top, reach = SETUP.geometry.size[2] + SETUP.tool.radius, SETUP.geometry.size[0] / 2 + SETUP.tool.radius
    keys: list[tuple[float, float, float, float]] = []
    for number, (x, y, depth) in enumerate(((0.0, 0.0, 4e-3), (0.012, 5e-3, 6e-3), (-0.012, -4e-3, 8e-3), (5e-3, -2e-3, 10e-3))):
        begin = 10.0 * number
        keys += [(begin + 0.5, x, y, top + 3e-3), (begin + 1, x, y, top), (begin + 5, x, y, top - depth), (begin + 9, x, y, top)]
        keys += [(begin + 9.5, x, y, top + 3e-3)]
    keys += [(40.2, 5e-3, -2e-3, 0.055), (40.5, reach + 8e-3, 0.0, 0.055), (40.8, reach + 8e-3, 0.0, 0.02), (41, reach, 0.0, 0.02)]
    keys += [(45, reach - 6e-3, 0.0, 0.02), (49, reach, 0.0, 0.02), (49.5, reach + 8e-3, 0.0, 0.02)]
    keys += [(50, reach + 8e-3, 0.0, 0.055), (50.5, -0.02, 5e-3, 0.055), (51, -0.02, 5e-3, top), (52, -0.02, 5e-3, top - 3e-3)]
    keys += [(58, 0.02, 5e-3, top - 3e-3), (59, 0.02, 5e-3, top), (60, 0.02, 5e-3, top + 6e-3)]
    table = np.array(keys)
    return np.stack([np.interp(np.arange(1800) / RATE, table[:, 0], table[:, axis]) for axis in (1, 2, 3)], axis=1)


def _force_at_four_millimetres(grid: GridSpec) -> float:
    height = SETUP.geometry.size[2] + SETUP.tool.radius
    frames = replay(SETUP, np.array([[0.0, 0.0, height - depth] for depth in (2e-3, 4e-3)]), grid)
    return float(frames[-1].force[2])


def _measure(case: Case) -> tuple[list[Equilibrium], float]:
    force = _force_at_four_millimetres(case.grid)  # warms up compiler and caches, too
    if abs(force / case.force - 1) > case.tolerance:
        raise RuntimeError(f"{case.name}: {force:.4f} N at 4 mm, {case.force:.4f} N expected within {case.tolerance:.0%}")
    centres = motion()[round(case.start * RATE) : round(case.stop * RATE)]
    frames, seconds = timed(lambda: replay(SETUP, centres, case.grid))
    require_converged(frames)
    return frames, seconds


def run() -> list[Table]:
    """Replay each case, check it, and tabulate CPU seconds per simulated second."""
    table = Table("grid", "frames", "in contact", "Newton steps", "ms a frame", "CPU s per s", title="Replay, one thread")
    for case in CASES:
        frames, seconds = _measure(case)
        touched = sum(frame.in_contact for frame in frames)
        steps = sum(frame.iterations for frame in frames) / max(touched, 1)
        each, ratio = 1e3 * seconds / len(frames), seconds / (len(frames) / RATE)
        table.add_row(case.name, str(len(frames)), str(touched), f"{steps:.1f}", f"{each:.1f}", f"{ratio:.2f}")
    others = Table("engine", "13x5x5", "25x9x9", title="Other engines, CPU s per simulated s")
    for name, figures in OTHERS.items():
        others.add_row(name, *figures)
    return [table, others]
