"""The potential of a block under a tool: elastic energy, own weight, bonded or detached base,
contact.

Everything is over E, so stiffness cancels where only positions are given; forces are multiplied by
E when they leave.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from palpate.fem.constitutive.elastic import Law, assemble_elastic, elastic_energy, lame
from palpate.fem.constitutive.stiffness_field import (
    SurfaceQuadrature,
    log_stiffness,
    surface_stiffness,
)
from palpate.fem.contact import assemble_contact, contact_energy
from palpate.fem.friction import FrictionPotential
from palpate.fem.linalg.sparsity import face_slots, factor_of, upper_pattern
from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.mesh.elements import Face, Quadrature, face_weights, quadrature
from palpate.mesh.protocol import Connectivity, Mesh
from palpate.setup.closest_point import winding_number
from palpate.setup.setup import Box, Detachment, Setup, Shape, Support

__all__ = [
    "CONTACT_STIFFNESS",
    "Assembly",
    "BlockModel",
    "ToolSphere",
    "Topology",
    "element_quadrature",
    "surface_quadrature",
    "topology",
]

CONTACT_STIFFNESS = 5e4
"""Contact pressure over E per penetration [1/m]: 0.02 mm at a pressure equal to E."""
BOND_STIFFNESS = 2e4
"""The same for a bonded base that is not simply held [1/m]."""
_BOND_EDGE = 1e-3
"""Width over which a bond ends at a detached strip's edge [m]: the result changes smoothly with the
strip's extent."""
_EMPTY = np.empty(0)


@dataclass(frozen=True, eq=False)
class ToolSphere:
    """The tool at one instant: centre (3,) [m] in the phantom frame, radius [m]."""

    centre: FloatArray
    radius: float


class AddedPotential(Protocol):
    """A quadratic potential of the unknowns' displacements that one step in time adds
    (`palpate.fem.history_stress`).
    """

    @property
    def data(self) -> FloatArray:
        """Its tangent's entries over E, in the pattern of the model's [m]."""

    def energy(self, displacement: FloatArray) -> float:
        """Over E [m^3]."""

    def force(self, displacement: FloatArray) -> FloatArray:
        """Its gradient over E (u,) [m^2]."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """Residual (u,) [m^2], entries of the tangent [m], push of the tool on the body (3,) [m^2] (all
    over E), penetration [m].
    """

    residual: FloatArray
    data: FloatArray
    push: FloatArray
    penetration: float


class Topology:
    """What meshes of one connectivity share wherever their nodes lie: numbering, matrix pattern,
    symbolic factorisation.
    """

    def __init__(self, connectivity: Connectivity, held: bool) -> None:
        self.element = connectivity.element
        self.elements = connectivity.elements
        self.surface, self.base, self.hull = (
            connectivity.surface,
            connectivity.base,
            connectivity.hull,
        )
        free = np.ones((connectivity.count, 3), dtype=bool)
        if held:
            free[connectivity.base_nodes] = False
        self.free = free
        self.unknown = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
        pattern, self.slots = upper_pattern(self.elements, self.unknown)
        self.surface_slots = face_slots(pattern, self.surface, self.unknown)
        self.base_slots = face_slots(pattern, self.base, self.unknown)
        self.pattern = pattern
        rows = np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
        self.diagonal = np.flatnonzero(rows == pattern.indices)
        self.factor = factor_of(pattern, single=True)


@lru_cache(maxsize=5)
def topology(connectivity: Connectivity, held: bool) -> Topology:
    """The shared part of all meshes with this connectivity; `held` leaves the base nodes out of the
    unknowns.
    """
    return Topology(connectivity, held)


def _held_share(
    detached: tuple[Detachment, ...], body: Box | Shape, points: FloatArray
) -> FloatArray:
    """Share of the bond (0 to 1) left at base points (..., 3) [m]."""
    held = np.ones(points.shape[:-1])
    for strip in detached:
        axis, sign = "xy".index(strip.edge[1]), -1 if strip.edge[0] == "-" else 1
        inwards = sign * ((body.low if sign < 0 else body.high)[axis] - points[..., axis])
        held *= 0.5 * (1 + np.tanh((inwards - strip.extent) / _BOND_EDGE))
    return held


def _sprung(support: Support) -> bool:
    """Whether the base can move against what it stands on."""
    return bool(support.detached) or support.stiffness_over_E is not None


@lru_cache(maxsize=12)
def element_quadrature(mesh: Mesh) -> Quadrature:
    """Quadrature of the elements: the mesh's alone."""
    shared = mesh.connectivity
    return quadrature(shared.element, mesh.nodes[shared.elements])


@lru_cache(maxsize=12)
def surface_quadrature(mesh: Mesh, face: Face) -> SurfaceQuadrature:
    """The free surface's points in this quadrature of the elements' sides."""
    corners = mesh.nodes[mesh.connectivity.surface]
    return SurfaceQuadrature(
        np.einsum("qa,fai->fqi", face.shapes, corners), np.sqrt(face_weights(face, corners))
    )


class BlockModel:
    """One block on one mesh: energy, residual and tangent as functions of the node positions (n, 3)
    [m] and the tool.

    Attributes:
        mu, bulk: (e, q) over E at the quadrature points [1].
        unrelaxed: mu before a step in time changes it (`palpate.replay.material_history`).
        areas: (f, p) of the free surface's quadrature points, times the stiffness there over E and
            the hardness [m^2], with which contact goes.
        hardness: of the contact, one unless `harden` was called [1].
        face: where the free surface feels the tool.
    """

    def __init__(self, setup: Setup, mesh: Mesh, *, dense: bool = False) -> None:
        """`dense` feels the tool at so many points that none fits between them (see
        `palpate.mesh.elements.Element`).
        """
        self.mesh, self.setup = mesh, setup
        self.topology = topology(mesh.connectivity, held=not _sprung(setup.support))
        element, height = self.topology.element, setup.geometry.height
        self.law, self.dense = Law.of(setup.material), dense
        self.face, self._base_face = element.dense_face if dense else element.face, element.face
        self.rule, spots = element_quadrature(mesh), surface_quadrature(mesh, self.face)
        self.areas, self.hardness = (
            spots.edges**2 * surface_stiffness(setup.material, spots, height),
            1.0,
        )
        self._all_areas = self.areas
        mu, bulk = lame(self.law, setup.material.poisson_ratio)
        factor = np.exp(log_stiffness(setup.material, self.rule, height))
        self.mu, self.bulk = mu * factor, bulk * factor
        self.unrelaxed = self.mu
        # Sums of squares near three lose their last digits when three is taken off, in proportion
        # to this stiffness times volume.
        self.rounding = 4e-16 * float(np.vdot(self.mu, self.rule.weights))
        self.added_potential: AddedPotential | None = None
        self.friction_potential: FrictionPotential | None = None
        self.weight_force = self._weight(setup.load.specific_weight_over_stiffness)
        self._prepare_base(setup)

    def factorise(self, data: FloatArray) -> None:
        """Factorise a tangent with these entries [m]; raises NotPositiveDefinite."""
        near = self.topology.unknown[self.mesh.near_focus].ravel()
        self.topology.factor.factorise(data, near[near >= 0])

    def harden(self, hardness: float) -> None:
        """Make the contact so many times as stiff as it is at first [1]."""
        if hardness != self.hardness:
            self.areas, self.hardness = self.areas * (hardness / self.hardness), hardness

    def restrict_to_facing(self, positions: FloatArray, tools: tuple[ToolSphere, ...]) -> None:
        """Feel these tools at all points that face one of them from positions (n, 3) [m], however
        they turn; only if dense.
        """
        if self.dense:
            facing = np.any([self.facing(positions, tool)[0] for tool in tools], axis=0)
            self.areas = np.where(facing, self._all_areas * self.hardness, 0.0)

    def add_penetrated(self, positions: FloatArray, tool: ToolSphere) -> bool:
        """Feel the tool also at points that have come to face it from within; whether there are
        any.
        """
        if not self.dense:
            return False
        facing, depth = self.facing(positions, tool)
        new = facing & (depth > 0) & (self.areas == 0)
        self.areas = np.where(new, self._all_areas * self.hardness, self.areas)
        return bool(new.any())

    def facing(self, positions: FloatArray, tool: ToolSphere) -> tuple[BoolArray, FloatArray]:
        """Which points (f, p) of the surface face a tool, and how deep they lie in it [m]."""
        corners = positions[self.topology.surface]
        seen = np.einsum("qa,fai->fqi", self.face.shapes, corners) - tool.centre
        tangents = np.einsum("qac,fai->fqci", self.face.gradients, corners)
        facing = np.einsum("fqi,fqi->fq", np.cross(tangents[:, :, 0], tangents[:, :, 1]), seen) < 0
        return facing, tool.radius - np.linalg.norm(seen, axis=2)

    def _weight(self, specific: float) -> FloatArray:
        """Weight at the nodes over E (n,) [m^2]."""
        share = np.zeros(len(self.mesh.nodes))
        if not specific:
            return share
        np.add.at(share, self.topology.elements, self.rule.weights @ self.topology.element.shapes)
        return specific * share

    def _prepare_base(self, setup: Setup) -> None:
        self.detached, self.sprung = bool(setup.support.detached), _sprung(setup.support)
        if not self.sprung:
            return
        corners = self.mesh.nodes[self.topology.base]
        areas, shapes = face_weights(self._base_face, corners), self._base_face.shapes
        points = np.einsum("qa,fai->fqi", shapes, corners)
        self.base_areas = areas
        held = areas * _held_share(setup.support.detached, setup.geometry, points)
        softness = 1 / BOND_STIFFNESS + (
            1 / setup.support.stiffness_over_E if setup.support.stiffness_over_E else 0.0
        )
        self.bond = 1 / softness * np.einsum("fq,qa,qb->fab", held, shapes, shapes)

    def _bond_gradient(self, positions: FloatArray) -> FloatArray:
        """Gradient of the bond's energy at the base faces' nodes (f, b, 3) [m^2]."""
        moved = (positions - self.mesh.nodes)[self.topology.base]
        return np.asarray(np.einsum("fab,fbi->fai", self.bond, moved))

    def energy(self, positions: FloatArray, tool: ToolSphere | None) -> float:
        """Total potential over E [m^3]; infinite when an element is inverted."""
        top = self.topology
        total = elastic_energy(self.law, self.rule, top.elements, self.mu, self.bulk, positions)
        if not np.isfinite(total):
            return np.inf
        total += float(self.weight_force @ (positions[:, 2] - self.mesh.nodes[:, 2]))
        if self.added_potential is not None:
            total += self.added_potential.energy((positions - self.mesh.nodes)[top.free])
        if tool is not None:
            total += contact_energy(
                top.surface,
                self.areas,
                self.face.shapes,
                self.face.gradients,
                positions,
                tool.centre,
                tool.radius,
                False,
                not self.dense,
                CONTACT_STIFFNESS,
            )
            if self.friction_potential is not None:
                total += self.friction_potential.energy(
                    top.surface, self.face, positions, tool.centre
                )
        if self.sprung:
            moved = (positions - self.mesh.nodes)[top.base]
            total += 0.5 * float(np.vdot(moved, self._bond_gradient(positions)))
        if self.detached:
            total += contact_energy(
                top.base,
                self.base_areas,
                self._base_face.shapes,
                self._base_face.gradients,
                positions,
                np.zeros(3),
                0.0,
                True,
                True,
                CONTACT_STIFFNESS,
            )
        return total

    def assemble(
        self,
        positions: FloatArray,
        tool: ToolSphere | None,
        *,
        tangent: bool = True,
        bending: bool = True,
    ) -> Assembly:
        """Residual and, if wanted, tangent at these positions; without `bending` the contact's
        tangent is positive.
        """
        top = self.topology
        force = np.zeros_like(positions)
        data = np.zeros(top.pattern.nnz) if tangent else _EMPTY
        push, penetration = np.zeros(3), 0.0
        assemble_elastic(
            self.law, self.rule, top.elements, self.mu, self.bulk, positions, top.slots, force, data
        )
        force[:, 2] += self.weight_force
        if tool is not None:
            penetration = assemble_contact(
                top.surface,
                self.areas,
                self.face.shapes,
                self.face.gradients,
                positions,
                tool.centre,
                tool.radius,
                False,
                not self.dense,
                CONTACT_STIFFNESS,
                bending,
                top.surface_slots,
                force,
                data,
                push,
            )
            if self.friction_potential is not None:
                self.friction_potential.assemble(
                    top.surface,
                    self.face,
                    positions,
                    tool.centre,
                    top.surface_slots,
                    force,
                    data,
                    push,
                )
        if self.sprung:
            self._assemble_base(positions, force, data)
        residual = force[top.free]
        if self.added_potential is not None:
            residual += self.added_potential.force((positions - self.mesh.nodes)[top.free])
            data = data + self.added_potential.data if tangent else data
        return Assembly(residual, data, push, penetration)

    def _assemble_base(self, positions: FloatArray, force: FloatArray, data: FloatArray) -> None:
        top = self.topology
        np.add.at(force, top.base, self._bond_gradient(positions))
        if len(data):
            size = 3 * self.bond.shape[1]
            blocks = np.einsum("fab,ij->faibj", self.bond, np.eye(3)).reshape(
                len(self.bond), size, size
            )
            used = top.base_slots >= 0
            np.add.at(data, top.base_slots[used], blocks[used])
        if not self.detached:
            return
        assemble_contact(
            top.base,
            self.base_areas,
            self._base_face.shapes,
            self._base_face.gradients,
            positions,
            np.zeros(3),
            0.0,
            True,
            True,
            CONTACT_STIFFNESS,
            False,
            top.base_slots,
            force,
            data,
            np.zeros(3),
        )

    def depth_inside(self, positions: FloatArray, tool: ToolSphere) -> float:
        """How deep the deepest node of the free surface lies inside the tool [m], whichever way it
        faces.
        """
        distance = np.linalg.norm(positions[self.topology.surface.ravel()] - tool.centre, axis=1)
        return max(0.0, tool.radius - float(distance.min()))

    def encloses(self, positions: FloatArray, tool: ToolSphere) -> bool:
        """Whether the tool's centre lies within the deformed block, where no contact would be
        felt."""
        return bool(winding_number(self.topology.hull, positions, tool.centre) > 0.5)
