"""A body whose supports the test chooses, built from the same assembly as the replay's blocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from palpate.fem.constitutive.elastic import Law, assemble_elastic, elastic_energy, lame
from palpate.fem.linalg.sparsity import factor_of, upper_pattern
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.box_mesh import BoxMesh, GridSpec, box_mesh
from palpate.mesh.elements import Quadrature, quadrature
from palpate.mesh.protocol import Mesh

__all__ = ["FreeBody", "distorted", "grid", "stretched_bar"]


def grid(size: tuple[float, float, float], nodes: tuple[int, int, int], order: int = 1) -> BoxMesh:
    """An even grid; edge lengths [m]."""
    return box_mesh(size, GridSpec(nodes=nodes, order=order))


def distorted(mesh: BoxMesh, share: float, seed: int) -> FloatArray:
    """Nodes (n, 3) [m] whose inner ones are moved at random by up to `share` of an element's
    edge."""
    nodes = mesh.nodes.copy()
    edge = np.array([np.diff(axis).min() for axis in mesh.axes])
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    inside = np.all((nodes > low + 1e-12) & (nodes < high - 1e-12), axis=1)
    nodes[inside] += np.random.default_rng(seed).uniform(-share, share, (inside.sum(), 3)) * edge
    return nodes


@dataclass(frozen=True, eq=False)
class FreeBody:
    """Modulus one: forces are over E [m^2], energies too [m^3].

    Attributes:
        mesh: which nodes form which element.
        nodes: (n, 3) rest positions [m].
        held: (n, 3) where the displacement is given.
        log_stiffness: its logarithm over the stated one at the quadrature points (e, q).
    """

    mesh: Mesh
    nodes: FloatArray
    law: Law
    poisson_ratio: float
    held: np.ndarray
    log_stiffness: Callable[[Quadrature], FloatArray] | None = None

    @cached_property
    def _parts(self) -> tuple[Quadrature, IntArray, FloatArray, FloatArray]:
        mu, bulk = lame(self.law, self.poisson_ratio)
        rule = quadrature(
            self.mesh.connectivity.element, self.nodes[self.mesh.connectivity.elements]
        )
        factor = np.exp(
            np.zeros(rule.weights.shape) if self.log_stiffness is None else self.log_stiffness(rule)
        )
        return rule, self.mesh.connectivity.elements, mu * factor, bulk * factor

    @cached_property
    def _system(self):
        unknown = np.where(self.held, -1, np.cumsum(~self.held).reshape(self.held.shape) - 1)
        pattern, slots = upper_pattern(self.mesh.connectivity.elements, unknown)
        return pattern, slots, factor_of(pattern)

    def energy(self, positions: FloatArray) -> float:
        """Over E [m^3]."""
        return elastic_energy(self.law, *self._parts, positions)

    def assemble(self, positions: FloatArray):
        """Internal forces (n, 3) over E [m^2] and the entries of the tangent of the unknowns
        [m]."""
        pattern, slots, _ = self._system
        force, data = np.zeros_like(positions), np.zeros(pattern.nnz)
        assemble_elastic(self.law, *self._parts, positions, slots, force, data)
        return force, data

    def tangent(self, positions: FloatArray) -> np.ndarray:
        """The whole symmetric matrix (u, u) [m]."""
        pattern, _, _ = self._system
        upper = pattern.copy()
        upper.data = self.assemble(positions)[1]
        dense = upper.toarray()
        return dense + np.triu(dense, 1).T

    def equilibrium(
        self, start: FloatArray, load: FloatArray | float = 0.0, tolerance: float = 1e-11
    ) -> tuple[FloatArray, FloatArray]:
        """Positions and internal forces (n, 3) under nodal loads over E [m^2], by Newton's method
        from `start`.
        """
        positions, free = start.copy(), ~self.held
        factor = self._system[2]
        for _ in range(25):
            force, data = self.assemble(positions)
            residual = (force - load)[free]
            # Forces of a hardly strained body are differences of large ones: no step takes the
            # residual below their rounding.
            rounding = np.finfo(float).eps * np.abs(data).max() * np.abs(positions).max()
            if np.linalg.norm(residual) < tolerance * np.linalg.norm(force) + rounding:
                return positions, force
            factor.factorise(data)
            positions[free] -= factor.solve(residual)
        raise AssertionError(f"no equilibrium: residual {np.linalg.norm(residual):.2g}")


def stretched_bar(
    law: Law, order: int, poisson_ratio: float, stretch: float
) -> tuple[float, FloatArray]:
    """Pull over E and cross-section [1] of a bar along x on rollers, and its transverse stretches
    (2,) [1], the same all along.
    """
    mesh = grid((0.04, 0.01, 0.01), (5, 3, 3), order)
    nodes = distorted(mesh, 0.2 / order, 8) - mesh.nodes.min(axis=0)
    ends = nodes[:, 0] > 0.04 - 1e-9
    held = np.abs(nodes) < 1e-9
    held[ends, 0] = True
    body = FreeBody(mesh, nodes, law, poisson_ratio, held)
    positions = nodes
    for last, now in pairwise(np.linspace(1, stretch, 9)):
        thinner = (now / last) ** -poisson_ratio
        positions, force = body.equilibrium(positions * np.array([now / last, thinner, thinner]))
    across = [positions[np.abs(nodes[:, axis] - 0.01) < 1e-9, axis] / 0.01 for axis in (1, 2)]
    assert max(map(np.ptp, across)) < 1e-9
    return force[ends, 0].sum() / 1e-4, np.array([side.mean() for side in across])
