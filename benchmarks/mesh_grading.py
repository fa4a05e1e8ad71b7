"""Accuracy of mesh gradings for pushes at seven places, not only in the middle of the top.

`python -m benchmarks.mesh_grading` makes the reference anew, on a grid of 10 353 nodes, and stores
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.cpu_time import timed
from benchmarks.reference_pokes import SETUP
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.graded_mesh import FINE_GRID, PAGE_GRID, REPLAY_GRID
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.replay import replay, require_converged, rest
from palpate.setup.setup import Load, Setup

__all__ = ["run"]

FINEST = GridSpec(nodes=(29, 21, 17), spacing=0.7e-3, order=2)
TARGET = (0.06, 0.06)
"""Largest errors of the mesh of `palpate replay` at any place, half way and at the end [1]."""
HEAVY = replace(SETUP, load=Load(specific_weight_over_stiffness=1.8))
SMOOTH, MOST_SAG = GridSpec(nodes=(33, 21, 19), spacing=1.5e-3, order=2), 30e-6
"""A mesh with the sag to a few um, and the largest error of the sag on a replay's mesh [m]."""
_FILE = Path(__file__).with_name("mesh_grading.npz")
GRIDS: dict[str, Meshing] = {
    "graded by size": REPLAY_GRID,
    "graded by size, fine": FINE_GRID,
    "graded by size, page": PAGE_GRID,
    "trilinear 15x11x9, 1.2 mm": GridSpec(nodes=(15, 11, 9), spacing=1.2e-3),
    "trilinear 21x15x12, 0.75 mm": GridSpec(nodes=(21, 15, 12), spacing=0.75e-3),
    "quadratic 13x9x9, 1.2 mm": GridSpec(nodes=(13, 9, 9), spacing=1.2e-3, order=2),
    "quadratic 17x13x9, 1.2 mm": GridSpec(nodes=(17, 13, 9), spacing=1.2e-3, order=2),
}


@dataclass(frozen=True, eq=False)
class Pushes:
    """The solution of all pushes, half way and at the end of each.

    Attributes:
        displacement: (7, 2, m, 3) displacement over the free surface [m].
        force: (7, 2, 3) force [N].
    """

    displacement: FloatArray
    force: FloatArray

    def errors(self, truth: Pushes) -> tuple[FloatArray, FloatArray]:
        """Return relative errors (7, 2) of displacement and of force."""
        miss = np.linalg.norm(self.displacement - truth.displacement, axis=(2, 3))
        force = np.linalg.norm(self.force - truth.force, axis=2)
        return miss / np.linalg.norm(truth.displacement, axis=(2, 3)), force / np.linalg.norm(
            truth.force, axis=2
        )


def _tool_paths() -> list[FloatArray]:
    """Return the tool centres (f, 3) [m] of each push.

    Four go into the top by 8 mm, two into the sides by 6 mm, and one is slanted, 6 mm long.
    """
    x, y, z = SETUP.geometry.size
    radius, deep, aside = (
        SETUP.tool.radius,
        np.arange(1, 9)[:, None] * 1e-3,
        np.arange(1, 7)[:, None] * 1e-3,
    )
    starts = [(0.0, 0.0), (0.012, 0.005), (-0.02, -0.008), (0.0071, -0.0113)]
    ways = [np.array([*place, z + radius]) - deep * [0, 0, 1] for place in starts]
    ways.append(np.array([x / 2 + radius, 0, 0.02]) - aside * [1, 0, 0])
    ways.append(np.array([0.008, -y / 2 - radius, 0.014]) + aside * [0, 1, 0])
    return [*ways, np.array([0.02, 0.01, z + radius]) + aside * [0.5, 0.2, -0.84]]


def _pushed(grid: Meshing) -> Pushes:
    points, displacement, force = SETUP.geometry.surface_points(), [], []
    for way in _tool_paths():
        frames = replay(SETUP, way, grid, tolerance=1e-4)
        require_converged(frames)
        keys = [frames[len(frames) // 2 - 1], frames[-1]]
        displacement.append([frame.move(points) - points for frame in keys])
        force.append([frame.force for frame in keys])
    return Pushes(np.array(displacement), np.array(force))


def _truth() -> Pushes:
    with np.load(_FILE) as stored:
        return Pushes(stored["displacement"].astype(float), stored["force"])


@dataclass(frozen=True)
class _FixedRefinement:
    """A mesh protocol whose mesh is refined at a fixed place, wherever the tool is.

    Attributes:
        grid: the mesh protocol.
        place: (3,) place of the tool that the mesh is made for [m].
    """

    grid: Meshing
    place: FloatArray

    def mesh(self, setup: Setup, centre: FloatArray) -> Mesh:
        return self.grid.mesh(setup, self.place)

    def finer(self) -> _FixedRefinement:
        return replace(self, grid=self.grid.finer())


def _sags() -> Table:
    """Return the error of a heavy block's sag, and its change with the place of refinement."""
    weight = HEAVY.load.specific_weight_over_stiffness
    title = f"Sag under {weight:g} /m, RMS; the mesh is refined at each of the places in turn"
    table = Table("mesh", "off by at most, um", "meshes apart by, um", title=title)
    points = HEAVY.geometry.surface_points()
    truth = rest(HEAVY, SMOOTH).move(points)
    for name, grid in {
        "graded by size, without a longest edge": replace(REPLAY_GRID, longest=1.0),
        **GRIDS,
    }.items():
        sags = [rest(HEAVY, _FixedRefinement(grid, way[-1])).move(points) for way in _tool_paths()]
        off = max(_rms(sag - truth) for sag in sags)
        apart = max(_rms(one - other) for one in sags for other in sags)
        table.add_row(name, f"{1e6 * off:.0f}", f"{1e6 * apart:.0f}")
        if grid is REPLAY_GRID and max(off, apart) > MOST_SAG:
            raise RuntimeError(
                f"the sag on a replay's mesh has an error of {1e6 * off:.0f} um and changes by "
                f"{1e6 * apart:.0f} um with the place of refinement"
            )
    table.caption = f"the sag itself: {1e3 * _rms(truth - points):.2f} mm"
    return table


def _rms(vectors: FloatArray) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def run() -> list[Table]:
    """Measure errors and time of each mesh.

    Raises RuntimeError where the mesh of `palpate replay` misses its target at any place.
    """
    title = "Seven pushes (top, sides, slanted), error over the free surface half way / at the end"
    table = Table(
        "mesh",
        "nodes",
        "worst place",
        "typical",
        "worst force",
        "typical",
        "ms a frame",
        title=title,
    )
    truth, count = _truth(), sum(len(way) for way in _tool_paths())
    for name, grid in GRIDS.items():
        _pushed(grid)  # warm-up
        solution, seconds = timed(partial(_pushed, grid))
        displacement, force = solution.errors(truth)
        nodes = len(grid.mesh(SETUP, _tool_paths()[0][-1]).nodes)
        both = [
            f"{a:.1%} / {b:.1%}"
            for error in (displacement, force)
            for a, b in (error.max(axis=0), np.median(error, axis=0))
        ]
        table.add_row(name, str(nodes), *both, f"{1e3 * seconds / count:.0f}")
        if grid is REPLAY_GRID and (displacement.max(axis=0) > TARGET).any():
            raise RuntimeError(f"the mesh of a replay has errors of {both[0]}")
    return [table, _sags()]


if __name__ == "__main__":
    solved = _pushed(FINEST)
    np.savez_compressed(
        _FILE, displacement=solved.displacement.astype(np.float32), force=solved.force
    )
