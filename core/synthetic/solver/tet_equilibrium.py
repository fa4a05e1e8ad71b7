"""Equilibria of the block under a rigid sphere that is moved by position: Newton with line search,
and steps split where needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.solver.coulomb_friction import Rub, assemble_rub
from palpate.synthetic.solver.gent_limit import assemble_stiffening, stiffening_energy
from palpate.synthetic.solver.holzapfel_fibres import assemble_fibres, fibre_energy
from palpate.synthetic.solver.mooney_rivlin import assemble_solid, constants, solid_energy
from palpate.synthetic.solver.obstacles import Obstacle, assemble_obstacle
from palpate.synthetic.solver.rest_metric import assemble_metric, metric_energy
from palpate.synthetic.solver.solid_model import Solid
from palpate.synthetic.solver.tet_block import Block, shape_values
from palpate.synthetic.solver.tet_system import System

__all__ = ["Equilibrium", "GivesWay", "State"]

PENALTY_OVER_E = 4.5e4
SOFTER = 1 / 12
_UNUSED = (
    np.zeros((1, 10, 10, 3, 3)),
    np.zeros((1, 3)),
    np.zeros(3),
    np.zeros((1, 3, 3)),
    np.zeros((3, 3)),
)
_NOWHERE = np.array([0.0, 0.0, 10.0])


class GivesWay(SolveError):
    """The block is about to jump: where Newton's method ended, its energy was not convex."""


@dataclass(frozen=True)
class State:
    """One equilibrium.

    Attributes:
        displacement: (n, 3) [m].
        centre: (3,) of the tool [m].
        push: (3,) force of the tool on the block [N].
        compliance: (3, 3) d push / d centre with everything else in equilibrium [N/m].
        penetration: the deepest surface point inside the tool [m].
    """

    displacement: FloatArray
    centre: FloatArray
    push: FloatArray
    compliance: FloatArray
    penetration: float


class Equilibrium:
    """Solves one block for one tool position after the other, starting each from the last.

    Attributes:
        metric: (e, q, 3, 3) of what the material remembers
            (`palpate.synthetic.solver.rest_metric`), over its shear modulus; None of none.
        rub: friction of the tool; None without.
    """

    def __init__(self, block: Block, solid: Solid) -> None:
        self.block = block
        self.solid = solid
        self.modulus = float(np.median(solid.young_modulus))
        self.metric: FloatArray | None = None
        self.rub: Rub | None = None
        self.hardest = PENALTY_OVER_E * float(np.sqrt(self.modulus * solid.young_modulus.max()))
        self._constants = self._elastic()
        self._shear = 2 * (self._constants[0] + self._constants[1])
        self._whole = self._shear / (1 - solid.relaxed)
        self._sole = block.elements[block.sole.owner]
        free = np.full(len(block.nodes), -1, dtype=np.int64)
        self._free = np.nonzero(~solid.held)[0]
        free[self._free] = np.arange(len(self._free))
        self._system = System(block.elements, free)
        self._stiffness = np.zeros((len(block.elements), 10, 10, 3, 3))
        self._load = self._own_weight()
        self._springs = self._under_base()
        self._beside = None if solid.neighbour is None else solid.neighbour.against(block)
        self._tolerance = 1e-4 * self.modulus * solid.tool_radius**2
        self.iterations = 0
        self._penalty = 0.0
        self._cautious = False
        self.rest = self._advance(np.zeros_like(block.nodes), _NOWHERE, 0)

    def _elastic(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        c10, c01, lame = constants(
            self.solid.young_modulus, self.solid.poisson_ratio, self.solid.relaxed
        )
        return c10, c01, np.average(lame, axis=1, weights=self.block.weights)

    def _own_weight(self) -> FloatArray:
        load = np.zeros_like(self.block.nodes)
        bary = shape_values()
        nodal = np.einsum("eq,qa->ea", self.block.weights, bary)
        np.add.at(load[:, 2], self.block.elements, -self.solid.weight * nodal)
        return load

    def _under_base(self) -> FloatArray:
        """Stiffness (f, 10, 10) [N/m] of the springs under the facets of the sole, the same in all
        directions.
        """
        sole, springs = self.block.sole, self.solid.springs
        if springs is None:
            return np.zeros((0, 10, 10))
        return np.asarray(
            np.einsum("fq,fqa,fqb->fab", springs * sole.weights, sole.values, sole.values)
        )

    def state(self, centre: FloatArray, start: State, guess: FloatArray | None = None) -> State:
        """The equilibrium with the tool's centre at `centre` [m], from `start` or a nearer `guess`
        of the displacement (n, 3) [m].

        Where Newton does not get there, it goes through a softer contact, and then in smaller steps
        from `start`.
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
    ) -> State:
        try:
            return self._newton(displacement, centre)
        except SolveError:
            if before is None or depth > 6:
                raise
            half = self._advance(displacement, 0.5 * (before + centre), depth + 1, before)
            return self._advance(half.displacement, centre, depth + 1, half.centre)

    def _newton(
        self, displacement: FloatArray, centre: FloatArray, limit: int = 14, softness: float = 1.0
    ) -> State:
        self._penalty = softness * self.hardest
        u = displacement.copy()
        energy = norm = np.inf
        convex = True
        for iteration in range(limit + 1):
            energy, force, push, coupling, total, deepest = self._assemble(u, centre)
            if not np.isfinite(energy):
                break
            residual = -force[self._free].ravel()
            norm = float(np.linalg.norm(residual))
            if norm < self._tolerance * (1.0 if softness == 1.0 else 30.0):
                return self._converged(u, centre, push, coupling, total, deepest, iteration)
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
        raise (SolveError if convex else GivesWay)(
            f"no equilibrium of the virtual block with the tool at {np.round(centre * 1e3, 2)} mm: residual {norm:.2g} N; "
            "use a finer grid or a shallower push",
            residual=norm,
        )

    def _factorise(self, u: FloatArray, centre: FloatArray) -> bool:
        """Factor the tangent of `_assemble`, or the cautious one where the energy is not convex;
        returns whether it is.
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
        push: FloatArray,
        coupling: FloatArray,
        total: FloatArray,
        deepest: float,
        iteration: int,
    ) -> State:
        compliance = np.zeros((3, 3))
        if np.any(total):
            if iteration == 0:
                self._system.factorise(self._stiffness)
            right = coupling[self._free].reshape(-1, 3)
            compliance = total - right.T @ self._system.solve(right)
        return State(u, centre, push, compliance, deepest)

    def _search(
        self, u: FloatArray, step: FloatArray, centre: FloatArray, energy: float, slope: float
    ) -> float:
        """How much of the step to take: none where even a small part does not lower the energy."""
        length = 1.0
        for _ in range(8):
            trial = self._energy(u + length * step, centre)
            if trial <= energy - 1e-4 * length * slope + 1e-9 * abs(energy):
                return length
            length *= 0.5
        return 0.0

    def _energy(self, u: FloatArray, centre: FloatArray) -> float:
        energy = self._stored(u)
        if np.isfinite(energy):
            for one in self._obstacles(centre):
                energy += self._press(u, one, False, _UNUSED)[0]
            energy += self._rubbed(u, centre, False, _UNUSED)
        return energy - float(np.sum(self._load * u))

    def _assemble(
        self, u: FloatArray, centre: FloatArray
    ) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray, float]:
        force = -self._load
        self._stiffness[:] = 0.0
        energy = self._stored(u)
        push, coupling, total, deepest = (
            np.zeros(3),
            np.zeros((len(u), 3, 3)),
            np.zeros((3, 3)),
            0.0,
        )
        if np.isfinite(energy):
            self._resist(u, force)
            for one in self._obstacles(centre):
                of_tool = (
                    (push, coupling, total)
                    if one.of_tool
                    else (np.zeros(3), np.zeros_like(coupling), np.zeros((3, 3)))
                )
                part, depth = self._press(u, one, True, (self._stiffness, force, *of_tool))
                energy += part
                # What a soft body gives way by is no penetration.
                deepest = max(deepest, depth) if one.penalty == self._penalty else deepest
            energy += self._rubbed(u, centre, True, (self._stiffness, force, push, coupling, total))
        return energy - float(np.sum(self._load * u)), force, push, coupling, total, deepest

    def _stored(self, u: FloatArray) -> float:
        """Energy [J] of the block and of the springs under it."""
        solid, grid = self.solid, (u, self.block.elements, self.block.gradients, self.block.weights)
        energy = float(solid_energy(*grid, *self._constants))
        if solid.stretch_limit is not None and np.isfinite(energy):
            energy += stiffening_energy(*grid, self._shear, solid.stretch_limit)
        if solid.fibres is not None:
            energy += fibre_energy(*grid, solid.fibre_modulus * solid.young_modulus, solid.fibres)
        if self.metric is not None and np.isfinite(energy):
            energy += metric_energy(*grid, self._whole, self.metric)
        if len(self._springs):
            moved = u[self._sole]
            energy += 0.5 * float(np.einsum("fai,fab,fbi->", moved, self._springs, moved))
        return energy

    def _resist(self, u: FloatArray, force: FloatArray) -> None:
        """Add what block and springs do to `force` (n, 3) [N] and to the stiffness."""
        solid, grid = self.solid, (u, self.block.elements, self.block.gradients, self.block.weights)
        assemble_solid(*grid, *self._constants, self._stiffness, force)
        if solid.stretch_limit is not None:
            assemble_stiffening(*grid, self._shear, solid.stretch_limit, self._stiffness, force)
        if solid.fibres is not None:
            assemble_fibres(
                *grid,
                solid.fibre_modulus * solid.young_modulus,
                solid.fibres,
                self._stiffness,
                force,
            )
        if self.metric is not None:
            assemble_metric(*grid, self._whole, self.metric, self._stiffness, force)
        if len(self._springs):
            np.add.at(force, self._sole, np.einsum("fab,fbi->fai", self._springs, u[self._sole]))
            np.add.at(
                self._stiffness, self.block.sole.owner, self._springs[..., None, None] * np.eye(3)
            )

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

    def _rubbed(
        self, u: FloatArray, centre: FloatArray, derivative: bool, out: tuple[FloatArray, ...]
    ) -> float:
        rub = self.rub
        if rub is None:
            return 0.0
        parts = (
            u,
            self.block.nodes,
            self.block.elements,
            rub.owner,
            rub.values,
            rub.limits,
            rub.normals,
            rub.before,
            rub.creep,
        )
        return float(assemble_rub(*parts, centre, derivative, *out))

    def close(self) -> None:
        """Give the factor's memory back."""
        self._system.close()
