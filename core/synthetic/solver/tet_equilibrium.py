"""Equilibria of the block under a rigid sphere of prescribed position.

Newton's method with a line search; load steps are split where it does not converge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.solver.coulomb_friction import FrictionContact, assemble_friction
from palpate.synthetic.solver.elastic_body import ElasticBody
from palpate.synthetic.solver.obstacles import Obstacle, assemble_obstacle
from palpate.synthetic.solver.solid_model import SolidModel
from palpate.synthetic.solver.tet_block import TetBlock
from palpate.synthetic.solver.tet_system import TetSystem

__all__ = ["InstabilityError", "TetSolver", "TetState"]

PENALTY_OVER_E = 4.5e4
"""Contact penalty over Young's modulus [1/m]."""
SOFTER = 1 / 12
"""Penalty of the softer contact over the normal one [1]."""
_UNUSED = (
    np.zeros((1, 10, 10, 3, 3)),
    np.zeros((1, 3)),
    np.zeros(3),
    np.zeros((1, 3, 3)),
    np.zeros((3, 3)),
)
_NOWHERE = np.array([0.0, 0.0, 10.0])


class InstabilityError(SolveError):
    """The block is unstable: the energy was not convex where Newton's method ended."""


@dataclass(frozen=True)
class TetState:
    """One equilibrium.

    Attributes:
        displacement: (n, 3) [m].
        centre: (3,) of the tool [m].
        tool_force: (3,) force of the tool on the block [N].
        contact_stiffness: (3, 3) d tool_force / d centre with all else in equilibrium [N/m].
        penetration: the deepest surface point inside the tool [m].
    """

    displacement: FloatArray
    centre: FloatArray
    tool_force: FloatArray
    contact_stiffness: FloatArray
    penetration: float


class TetSolver:
    """Solves one block for one tool position after another, each from the previous one.

    Attributes:
        block: the mesh.
        solid: material and supports.
        body: its elastic energy.
        modulus: median of Young's modulus [Pa].
        hardest: penalty of the contact [Pa/m].
        metric: (e, q, 3, 3) natural metric over the shear modulus, of a material with a history
            (`palpate.synthetic.solver.rest_metric`); None without.
        friction_contact: friction of the tool; None without.
        rest: the equilibrium without the tool.
        iterations: Newton steps so far.
    """

    def __init__(self, block: TetBlock, solid: SolidModel) -> None:
        self.block = block
        self.solid = solid
        self.modulus = float(np.median(solid.young_modulus))
        self.metric: FloatArray | None = None
        self.friction_contact: FrictionContact | None = None
        self.hardest = PENALTY_OVER_E * float(np.sqrt(self.modulus * solid.young_modulus.max()))
        self.body = ElasticBody(block, solid)
        free = np.full(len(block.nodes), -1, dtype=np.int64)
        self._free = np.nonzero(~solid.held)[0]
        free[self._free] = np.arange(len(self._free))
        self._system = TetSystem(block.elements, free)
        self._stiffness = np.zeros((len(block.elements), 10, 10, 3, 3))
        self._beside = None if solid.neighbour is None else solid.neighbour.against(block)
        self._tolerance = 1e-4 * self.modulus * solid.tool_radius**2
        self.iterations = 0
        self._penalty = 0.0
        self._cautious = False
        self.rest = self._advance(np.zeros_like(block.nodes), _NOWHERE, 0)

    def state(
        self, centre: FloatArray, start: TetState, guess: FloatArray | None = None
    ) -> TetState:
        """The equilibrium with the tool's centre at `centre` (3,) [m].

        Where Newton's method does not converge, it is repeated through a softer contact, and then
        in smaller steps from `start`.

        Args:
            centre: (3,) [m].
            start: an equilibrium near by.
            guess: (n, 3) initial displacement [m]; that of `start` without it.
        """
        displacement = start.displacement if guess is None else guess
        try:
            return self._newton(displacement, centre, 10)
        except SolveError:
            pass
        try:
            return self._newton(self._newton(displacement, centre, 12, SOFTER).displacement, centre)
        except SolveError:
            return self._advance(start.displacement, centre, 0, start.centre)

    def _advance(
        self,
        displacement: FloatArray,
        centre: FloatArray,
        depth: int,
        before: FloatArray | None = None,
    ) -> TetState:
        try:
            return self._newton(displacement, centre)
        except SolveError:
            if before is None or depth > 6:
                raise
            half = self._advance(displacement, 0.5 * (before + centre), depth + 1, before)
            return self._advance(half.displacement, centre, depth + 1, half.centre)

    def _newton(
        self, displacement: FloatArray, centre: FloatArray, limit: int = 14, softness: float = 1.0
    ) -> TetState:
        self._penalty = softness * self.hardest
        u = displacement.copy()
        energy = norm = np.inf
        convex = True
        for iteration in range(limit + 1):
            energy, force, tool_force, coupling, total, deepest = self._assemble(u, centre)
            if not np.isfinite(energy):
                break
            residual = -force[self._free].ravel()
            norm = float(np.linalg.norm(residual))
            if norm < self._tolerance * (1.0 if softness == 1.0 else 30.0):
                return self._converged(u, centre, tool_force, coupling, total, deepest, iteration)
            if iteration == limit:
                break
            self.iterations += 1
            convex = self._factorise(u, centre)
            step = np.zeros_like(u)
            step[self._free] = self._system.solve(residual).reshape(-1, 3)
            length = self._search(
                u, step, centre, energy, float(step[self._free].ravel() @ residual)
            )
            if length == 0.0:
                break
            u += length * step
        raise (SolveError if convex else InstabilityError)(
            f"no equilibrium of the virtual block with the tool at {np.round(centre * 1e3, 2)} mm: "
            f"residual {norm:.2g} N; use a finer grid or a shallower push",
            residual=norm,
        )

    def _factorise(self, u: FloatArray, centre: FloatArray) -> bool:
        """Factor the assembled tangent, or the cautious one where the energy is not convex.

        Returns:
            whether the energy is convex.
        """
        self._system.factorise(self._stiffness)
        if not self._system.negative:
            return True
        self._cautious = True
        self._assemble(u, centre)
        self._cautious = False
        self._system.factorise(self._stiffness)
        return False

    def _converged(
        self,
        u: FloatArray,
        centre: FloatArray,
        tool_force: FloatArray,
        coupling: FloatArray,
        total: FloatArray,
        deepest: float,
        iteration: int,
    ) -> TetState:
        contact_stiffness = np.zeros((3, 3))
        if np.any(total):
            if iteration == 0:
                self._system.factorise(self._stiffness)
            right = coupling[self._free].reshape(-1, 3)
            contact_stiffness = total - right.T @ self._system.solve(right)
        return TetState(u, centre, tool_force, contact_stiffness, deepest)

    def _search(
        self, u: FloatArray, step: FloatArray, centre: FloatArray, energy: float, slope: float
    ) -> float:
        """Length of the step by backtracking [1]; zero where no part of it lowers the energy."""
        length = 1.0
        for _ in range(8):
            trial = self._energy(u + length * step, centre)
            if trial <= energy - 1e-4 * length * slope + 1e-9 * abs(energy):
                return length
            length *= 0.5
        return 0.0

    def _energy(self, u: FloatArray, centre: FloatArray) -> float:
        energy = self.body.energy(u, self.metric)
        if np.isfinite(energy):
            for one in self._obstacles(centre):
                energy += self._press(u, one, False, _UNUSED)[0]
            energy += self._add_friction(u, centre, False, _UNUSED)
        return energy - float(np.sum(self.body.load * u))

    def _assemble(
        self, u: FloatArray, centre: FloatArray
    ) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray, float]:
        force = -self.body.load
        self._stiffness[:] = 0.0
        energy = self.body.energy(u, self.metric)
        tool_force, coupling, total, deepest = (
            np.zeros(3),
            np.zeros((len(u), 3, 3)),
            np.zeros((3, 3)),
            0.0,
        )
        if np.isfinite(energy):
            self.body.assemble(u, self.metric, self._stiffness, force)
            for one in self._obstacles(centre):
                of_tool = (
                    (tool_force, coupling, total)
                    if one.of_tool
                    else (np.zeros(3), np.zeros_like(coupling), np.zeros((3, 3)))
                )
                part, depth = self._press(u, one, True, (self._stiffness, force, *of_tool))
                energy += part
                # The deformation of a soft neighbour is no penetration.
                deepest = max(deepest, depth) if one.penalty == self._penalty else deepest
            energy += self._add_friction(
                u, centre, True, (self._stiffness, force, tool_force, coupling, total)
            )
        energy -= float(np.sum(self.body.load * u))
        return energy, force, tool_force, coupling, total, deepest

    def _obstacles(self, centre: FloatArray) -> list[Obstacle]:
        block, solid = self.block, self.solid
        found = [Obstacle(block.skin, centre, np.zeros(3), solid.tool_radius, self._penalty, True)]
        if solid.shaft is not None:
            rod = solid.shaft
            found.append(
                Obstacle(block.skin, centre, rod.length * rod.away, rod.radius, self._penalty, True)
            )
        if solid.lifts:
            found.append(
                Obstacle(
                    block.sole, np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.0, self._penalty, False
                )
            )
        return found + ([self._beside] if self._beside is not None else [])

    def _press(
        self, u: FloatArray, one: Obstacle, derivative: bool, out: tuple[FloatArray, ...]
    ) -> tuple[float, float]:
        block, sampling = self.block, one.sampling
        parts = (u, block.nodes, block.elements, sampling.owner, sampling.values, sampling.weights)
        energy, deepest = assemble_obstacle(
            *parts, one.centre, one.along, one.radius, one.penalty, self._cautious, derivative, *out
        )
        return float(energy), float(deepest)

    def _add_friction(
        self, u: FloatArray, centre: FloatArray, derivative: bool, out: tuple[FloatArray, ...]
    ) -> float:
        friction_contact = self.friction_contact
        if friction_contact is None:
            return 0.0
        parts = (
            u,
            self.block.nodes,
            self.block.elements,
            friction_contact.owner,
            friction_contact.values,
            friction_contact.limits,
            friction_contact.normals,
            friction_contact.before,
            friction_contact.creep,
        )
        return float(assemble_friction(*parts, centre, derivative, *out))

    def close(self) -> None:
        """Free the factor's memory."""
        self._system.close()
