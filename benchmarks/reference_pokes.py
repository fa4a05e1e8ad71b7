"""Converged reference solution of two pokes, by which meshes are judged.

The pokes go straight down in the middle of the top by 4 and 8 mm, on quadratic hexahedra with
0.6 mm between nodes at the tool. Trilinear elements with 0.5 mm between nodes differ by 1.5 and
2.1 % of the displacement and 0.9 % of the force, which limits every comparison.

`python -m benchmarks.reference_pokes` solves and stores the reference anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, replay, require_converged
from palpate.setup.setup import Box, Setup, Tool

__all__ = [
    "DEPTHS",
    "SETUP",
    "Pokes",
    "compared",
    "poke_centres",
    "poke_frames",
    "reference",
    "top_points",
]

SETUP = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=5e-3), mass=0.104)
DEPTHS = (4e-3, 8e-3)
_WAY = np.arange(1, 9) * 1e-3
FINEST = GridSpec(nodes=(33, 25, 17), spacing=0.6e-3, order=2)
_FILE = Path(__file__).with_name("reference_pokes.npz")


@dataclass(frozen=True, eq=False)
class Pokes:
    """The solution at the two depths.

    Attributes:
        displacement: (2, m, 3) displacement of points on a grid over the top [m].
        force: (2,) vertical force [N].
    """

    displacement: FloatArray
    force: FloatArray

    def error(self, other: Pokes) -> tuple[FloatArray, FloatArray]:
        """Return relative errors (2,) of displacement (RMS) and force of another solution."""
        miss = np.linalg.norm(other.displacement - self.displacement, axis=(1, 2))
        return miss / np.linalg.norm(self.displacement, axis=(1, 2)), other.force / self.force - 1


def poke_centres() -> FloatArray:
    """Return the tool centres (8, 3) [m], from 1 to 8 mm deep."""
    return np.array(
        [[0.0, 0.0, SETUP.geometry.size[2] + SETUP.tool.radius - depth] for depth in _WAY]
    )


def poke_frames(grid: Meshing, setup: Setup = SETUP) -> list[Equilibrium]:
    """Return the equilibria at the two depths, reached in steps of 1 mm."""
    frames = replay(setup, poke_centres(), grid, tolerance=1e-5)
    require_converged(frames)
    return [frames[int(np.argmin(np.abs(_WAY - depth)))] for depth in DEPTHS]


def top_points() -> FloatArray:
    """Return rest positions (m, 3) [m] of the points at which displacements are compared."""
    x, y, z = SETUP.geometry.size
    across = np.meshgrid(
        np.linspace(-x / 2, x / 2, 49), np.linspace(-y / 2, y / 2, 29), indexing="ij"
    )
    return np.stack([across[0].ravel(), across[1].ravel(), np.full(across[0].size, z)], axis=1)


def compared(frames: Sequence[Equilibrium]) -> Pokes:
    """Return displacement and force of the two equilibria."""
    points = top_points()
    return Pokes(
        np.stack([frame.move(points) - points for frame in frames]),
        np.array([frame.force[2] for frame in frames]),
    )


def reference() -> Pokes:
    """Return the stored reference."""
    with np.load(_FILE) as stored:
        return Pokes(stored["displacement"].astype(float), stored["force"])


if __name__ == "__main__":
    solution = compared(poke_frames(FINEST))
    np.savez_compressed(
        _FILE, displacement=solution.displacement.astype(np.float32), force=solution.force
    )
