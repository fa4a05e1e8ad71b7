"""Potential of a body under a tool: elastic energy, weight, bonded or detached base, contact.

Everything is divided by E, so that stiffness cancels if only positions are given; forces are
multiplied by E where they leave the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from palpate.fem.base_support import BOND_STIFFNESS, base_can_move, held_share
from palpate.fem.constitutive.elastic import Law, assemble_elastic, elastic_energy, lame
from palpate.fem.constitutive.stiffness_field import log_stiffness, surface_stiffness
from palpate.fem.contact import assemble_contact, contact_energy
from palpate.fem.friction import FrictionPotential
from palpate.fem.mesh_quadrature import element_quadrature, surface_quadrature
from palpate.fem.topology import topology
from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.mesh.elements import face_weights
from palpate.mesh.protocol import Mesh
from palpate.setup.free_form.closest_point import winding_number
from palpate.setup.setup import Setup

__all__ = ["CONTACT_STIFFNESS", "Assembly", "BlockModel", "ToolSphere"]

CONTACT_STIFFNESS = 5e4
"""Contact pressure over E per penetration [1/m]: 0.02 mm at a pressure equal to E."""
_EMPTY = np.empty(0)
_ASSEMBLY = 0.2
"""Work of an assembly, in factorisations of the tangent: 5 for 25 ms on the grid of the page."""


@dataclass(frozen=True, eq=False)
class ToolSphere:
    """The tool at one instant.

    Attributes:
        centre: (3,) [m], phantom frame.
        radius: [m].
    """

    centre: FloatArray
    radius: float


class AddedPotential(Protocol):
    """A quadratic potential of the unknowns' displacements, constant over one time step.

    `palpate.fem.history.history_stress` makes one.
    """

    @property
    def data(self) -> FloatArray:
        """Entries of its tangent over E [m], in the pattern of the model's."""

    def energy(self, displacement: FloatArray) -> float:
        """Energy over E [m^3]."""

    def force(self, displacement: FloatArray) -> FloatArray:
        """Gradient of the energy over E (u,) [m^2]."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """Residual and tangent at one state, over E.

    Attributes:
        residual: (u,) [m^2].
        data: entries of the tangent [m].
        push: of the tool on the body (3,) [m^2].
        penetration: deepest [m].
    """

    residual: FloatArray
    data: FloatArray
    push: FloatArray
    penetration: float


class BlockModel:
    """One body on one mesh: energy, residual and tangent as functions of positions and tool.

    Node positions are (n, 3) [m].

    Attributes:
        mu: (e, q) shear modulus over E at the quadrature points [1].
        bulk: (e, q) volumetric modulus over E [1].
        unrelaxed: `mu` before a time step changes it (`palpate.replay.material_history`).
        areas: (f, p) weights of the contact at the free surface's quadrature points [m^2]: area
            times surface stiffness over E times `hardness`.
        hardness: factor on the contact stiffness [1], one unless `harden` was called.
        face: quadrature of the sides at which contact is evaluated.
        spend: is told the work of each step, in factorisations; it may raise to end a solve.
    """

    def __init__(self, setup: Setup, mesh: Mesh, *, dense: bool = False) -> None:
        """Make the model.

        Args:
            setup: the experiment.
            mesh: of the body.
            dense: evaluate contact at so many points that no tool fits between them (see
                `palpate.mesh.elements.Element`).
        """
        self.mesh, self.setup = mesh, setup
        self.topology = topology(mesh.connectivity, held=not base_can_move(setup.support))
        element = self.topology.element
        self.law, self.dense = Law.of(setup.material), dense
        self.face, self._base_face = element.dense_face if dense else element.face, element.face
        self.rule, surface = element_quadrature(mesh), surface_quadrature(mesh, self.face)
        self.areas = surface.edges**2 * surface_stiffness(setup.material, surface, setup.geometry)
        self.hardness = 1.0
        self._all_areas = self.areas
        mu, bulk = lame(self.law, setup.material.poisson_ratio)
        factor = np.exp(log_stiffness(setup.material, self.rule, setup.geometry))
        self.mu, self.bulk = mu * factor, bulk * factor
        self.unrelaxed = self.mu
        # Rounding error of the energy: sums of squares near three lose their last digits when three
        # is subtracted, in proportion to stiffness times volume.
        self.rounding = 4e-16 * float(np.vdot(self.mu, self.rule.weights))
        self.spend: Callable[[float], None] = lambda work: None
        self.added_potential: AddedPotential | None = None
        self.friction_potential: FrictionPotential | None = None
        self.weight_force = self._weight(setup.load.specific_weight_over_stiffness)
        self._prepare_base(setup)

    def factorise(self, data: FloatArray) -> None:
        """Factorise a tangent with these entries [m]; raises NotPositiveDefinite."""
        self.spend(1.0)
        self.topology.factor.factorise(data)

    def harden(self, hardness: float) -> None:
        """Multiply the contact stiffness by this factor over its initial value [1]."""
        if hardness != self.hardness:
            self.areas, self.hardness = self.areas * (hardness / self.hardness), hardness

    def restrict_to_facing(self, positions: FloatArray, tools: tuple[ToolSphere, ...]) -> None:
        """Evaluate contact at all points that face one of the tools at these positions, and no
        others.

        Points keep their state while they turn. Only a dense model is changed.
        """
        if self.dense:
            facing = np.any([self.facing(positions, tool)[0] for tool in tools], axis=0)
            self.areas = np.where(facing, self._all_areas * self.hardness, 0.0)

    def add_penetrated(self, positions: FloatArray, tool: ToolSphere) -> bool:
        """Evaluate contact also at points inside the tool that have come to face it.

        Returns True if there are any.
        """
        if not self.dense:
            return False
        facing, depth = self.facing(positions, tool)
        new = facing & (depth > 0) & (self.areas == 0)
        self.areas = np.where(new, self._all_areas * self.hardness, self.areas)
        return bool(new.any())

    def facing(self, positions: FloatArray, tool: ToolSphere) -> tuple[BoolArray, FloatArray]:
        """Which points (f, p) of the surface face a tool, and their depth inside it (f, p) [m]."""
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
        self.detached, self.sprung = bool(setup.support.detached), base_can_move(setup.support)
        if not self.sprung:
            return
        corners = self.mesh.nodes[self.topology.base]
        areas, shapes = face_weights(self._base_face, corners), self._base_face.shapes
        points = np.einsum("qa,fai->fqi", shapes, corners)
        self.base_areas = areas
        held = areas * held_share(setup.support.detached, setup.geometry, points)
        softness = 1 / BOND_STIFFNESS + (
            1 / setup.support.stiffness_over_E if setup.support.stiffness_over_E else 0.0
        )
        self.bond = 1 / softness * np.einsum("fq,qa,qb->fab", held, shapes, shapes)

    def _bond_gradient(self, positions: FloatArray) -> FloatArray:
        """Gradient of the bond's energy at the base faces' nodes (f, b, 3) [m^2]."""
        moved = (positions - self.mesh.nodes)[self.topology.base]
        return np.asarray(np.einsum("fab,fbi->fai", self.bond, moved))

    def energy(self, positions: FloatArray, tool: ToolSphere | None) -> float:
        """Total potential over E [m^3]; infinite if an element is inverted."""
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
        """Assemble residual and tangent at these positions.

        Args:
            positions: (n, 3) [m].
            tool: None for no tool.
            tangent: False leaves the tangent out.
            bending: False leaves out the contact's curvature, which makes its tangent positive.
        """
        self.spend(_ASSEMBLY)
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
        """Depth of the deepest node of the free surface inside the tool [m], whichever way it
        faces.
        """
        distance = np.linalg.norm(positions[self.topology.surface.ravel()] - tool.centre, axis=1)
        return max(0.0, tool.radius - float(distance.min()))

    def encloses(self, positions: FloatArray, tool: ToolSphere) -> bool:
        """Whether the tool's centre lies inside the deformed body, where contact has no effect."""
        return bool(winding_number(self.topology.hull, positions, tool.centre) > 0.5)
