"""Interior fields of a body in each frame of a recording: displacement and energy density on a
grid, which is that of the nodes for a block.

Meshes follow the tool, so that each frame stores its node coordinates, as three axes. Values
between the nodes are interpolated linearly: that is enough for pictures, and quadratic shape
functions would give negative energies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from palpate.fem.energy_density import nodal_density
from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Setup

__all__ = ["InteriorFields"]

_PARTS = ("inside_counts", "inside_axes", "inside_moved", "inside_energy", "inside_modulus")


@dataclass(frozen=True, eq=False)
class InteriorFields:
    """Grid over the body in each of f frames, phantom frame.

    Attributes:
        counts: (f, 3) grid points along x, y, z.
        axes: their coordinates at rest in the stated body, frame after frame [m].
        moved: (n, 3) displacement of all grid points [m], frame after frame, x fastest.
        energy: (n,) elastic energy density over E [1]; NaN in frames without equilibrium or with an
            inverted element.
        modulus: E as assumed [Pa].
    """

    counts: IntArray
    axes: FloatArray
    moved: FloatArray
    energy: FloatArray
    modulus: float

    @classmethod
    def of(cls, setup: Setup, frames: Sequence[Equilibrium]) -> Self:
        """Compute the fields of a replay's frames."""
        counts: list[tuple[int, int, int]] = []
        axes: list[FloatArray] = []
        moved: list[FloatArray] = []
        energy: list[FloatArray] = []
        longer = setup.scale
        for frame in frames:
            mesh = frame.mesh
            x, y, z = mesh.axes
            counts.append((len(x), len(y), len(z)))
            axes.extend(axis / part for axis, part in zip(mesh.axes, longer, strict=True))
            # A correction on top of the equilibrium is included.
            places = frame.move(mesh.nodes)
            moved.append(mesh.on_axes(places - mesh.nodes / longer))
            with np.errstate(invalid="ignore", divide="ignore"):
                density = nodal_density(BlockModel(setup, mesh), places)
            energy.append(mesh.on_axes(density[:, None])[:, 0])
        with np.errstate(over="ignore"):
            return cls(
                np.array(counts, dtype=np.int32),
                _small(axes, np.float32),
                _small(moved, np.float16),
                _small(energy, np.float16),
                setup.material.young_modulus,
            )

    def arrays(self, model: str) -> dict[str, Any]:
        """Arrays for a file, with names that end with the model's."""
        values = (self.counts, self.axes, self.moved, self.energy, np.array(self.modulus))
        return {f"{part}_{model}": value for part, value in zip(_PARTS, values, strict=True)}

    @classmethod
    def read(cls, arrays: Mapping[str, Any], model: str) -> Self | None:
        """Read the fields from such a file; None if it has none of this model."""
        if any(f"{part}_{model}" not in arrays for part in _PARTS):
            return None
        counts, axes, moved, energy, modulus = (arrays[f"{part}_{model}"] for part in _PARTS)
        return cls(counts, axes, moved, energy, float(modulus))

    def displacement(self, frame: int, places: FloatArray) -> FloatArray:
        """Displacement (m, 3) [m] of the material at rest positions `places` (m, 3) [m] in the
        stated block.
        """
        return self._between(self.moved, frame, places)

    def energy_density(self, frame: int, places: FloatArray) -> FloatArray:
        """Elastic energy per rest volume (m,) [J/m^3] at the same places, with the assumed
        modulus.
        """
        return self._between(self.energy, frame, places) * self.modulus

    @cached_property
    def _begins(self) -> tuple[IntArray, IntArray]:
        """Index of the first axis coordinate and the first node of each frame."""
        nodes = np.prod(self.counts.astype(np.int64), axis=1)
        return np.cumsum(self.counts.sum(axis=1)) - self.counts.sum(axis=1), np.cumsum(
            nodes
        ) - nodes

    def _between(self, values: FloatArray, frame: int, places: FloatArray) -> FloatArray:
        """Interpolate nodal values of one frame trilinearly."""
        nx, ny, nz = (int(count) for count in self.counts[frame])
        at, first = self._begins[0][frame], self._begins[1][frame]
        own = np.split(np.asarray(self.axes[at : at + nx + ny + nz], dtype=float), [nx, nx + ny])
        grid = np.asarray(values[first : first + nx * ny * nz], dtype=float).reshape(
            nz, ny, nx, *values.shape[1:]
        )
        return trilinear(own, grid, np.asarray(places, dtype=float))


def _small(parts: list[FloatArray], kind: type[Any]) -> Any:
    return np.concatenate(parts).astype(kind)


def trilinear(axes: Sequence[FloatArray], grid: FloatArray, places: FloatArray) -> FloatArray:
    """Interpolate a grid (nz, ny, nx, ...) on these axes at places (m, 3); outside is moved to the
    border.
    """
    lower, parts = [], []
    for axis, at in zip(axes, places.T, strict=True):
        index = np.clip(np.searchsorted(axis, at, side="right") - 1, 0, len(axis) - 2)
        lower.append(index)
        parts.append(np.clip((at - axis[index]) / (axis[index + 1] - axis[index]), 0.0, 1.0))
    total = np.zeros((len(places), *grid.shape[3:]))
    for dx in (0, 1):
        for dy in (0, 1):
            for dz in (0, 1):
                corner = [
                    part if step else 1 - part
                    for part, step in zip(parts, (dx, dy, dz), strict=True)
                ]
                weight = corner[0] * corner[1] * corner[2]
                value = grid[lower[2] + dz, lower[1] + dy, lower[0] + dx]
                total += weight[:, None] * value if value.ndim > 1 else weight * value
    return total
