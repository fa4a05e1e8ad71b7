"""Material history: stress relaxation and permanent set. Both act on the shear stress; the pressure
is elastic.

Finite linear viscoelasticity (Simo 1987; Holzapfel 2000, sec. 6.10): with S the second
Piola-Kirchhoff shear stress of the elastic law, fibres included, T that of the permanent strain,
and a Prony series of shares g_i and time constants tau_i,

    stress = pressure + (1 - sum g_i) (S - T) + sum h_i,    h_i' + h_i / tau_i = g_i (S - T)'

so E is the modulus of a motion faster than any tau. Over a step of length t in which S - T changes
evenly the solution is exact, h_i <- e^(-t/tau_i) h_i + g_i r_i (change of S - T) with r_i = (1 -
e^(-t/tau_i)) tau_i / t (Taylor, Pister and Goudreau 1970), however long the step; any other change
of the strain between two frames is lost. In a step the new stress is a multiple of S and a part
fixed by the past (`palpate.fem.history.history_stress`), which keeps its direction in the body
while the strain goes on. That causes a pressure of second order in the strain's change, which a
stiff bulk modulus hides.

Permanent set: with L the logarithmic strain without the volumetric part, a point stores a strain M
that grows along L by the excess of |L| over its largest earlier value (backward Euler from frame to
frame). The retained share of M is free of stress: a bar stretched to l at constant volume, and
released, stays at l^share. The set is immediate, so a first push is softer than a second by about
that share; the second changes nothing unless it goes further. There is no threshold strain, and no
recovery by creep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.fem.constitutive.elastic import Law
from palpate.fem.continuation import move_tool
from palpate.fem.history.history_stress import ConstantStress, shear_stress
from palpate.fem.history.material_points import MaterialPoints, material_points
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import Outcome, Solution, relative_residual, solve
from palpate.fem.strain_tensors import cauchy_green, from_log_strain, log_strain
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Material, Setup

__all__ = ["HistoryVariables", "MaterialHistory", "ReplayState", "TimeStep", "require_memoryless"]

_MOST_ROUNDS = 100
"""Largest number of equilibria in one frame until one is consistent with its own set. Each leaves
about the retained share of the last one's error."""


@dataclass(frozen=True, eq=False)
class HistoryVariables:
    """State of the material after a frame, at its points; stresses are over the local shear modulus
    [1].

    Attributes:
        time: of the frame [s]; None before the first.
        touched: whether the tool was ever in contact.
        delayed: (k, m, 6) h of each term.
        driving: (m, 6) S - T.
        largest: (m,) |L|.
        stored_strain: (m, 6) M.
        free: (m, 6) T.
    """

    time: float | None
    touched: bool
    delayed: FloatArray
    driving: FloatArray
    largest: FloatArray
    stored_strain: FloatArray
    free: FloatArray


@dataclass(frozen=True, eq=False)
class ReplayState:
    """State from which a replay can continue.

    Attributes:
        frame: the last one.
        history: of the material after it; None without history.
    """

    frame: Equilibrium
    history: HistoryVariables | None


@dataclass(frozen=True, eq=False)
class TimeStep:
    """Coefficients of one time step.

    Attributes:
        left: (k,) factor on each h.
        taken: (k,) factor on the change of S - T in each h.
        factor: of S in the stress.
    """

    left: FloatArray
    taken: FloatArray
    factor: float


def require_memoryless(material: Material, what: str) -> None:
    """Raise SetupError if the material has history.

    Args:
        material: to check.
        what: begins the message; names what ignores the past.
    """
    if material.has_history:
        key = "relaxation" if material.relaxation else "retained_fraction"
        raise SetupError(f"{what} leave out the material's {key}", key=key)


class MaterialHistory:
    """History of one block's material.

    `begin` a time step, `apply_to` the models, and `end` it with the equilibrium.

    Attributes:
        history: after the last frame that was an equilibrium; before the first, that of a block
            long at rest.
        step: the current one.
        law: of S.
        points: at which the history is stored.
        fraction: retained share of M.
    """

    def __init__(self, setup: Setup, points: MaterialPoints, mesh: Mesh) -> None:
        material = setup.material
        self.law, self.points, self.fraction = Law.of(material), points, material.retained_fraction
        self._shares = np.array([term.fraction for term in material.relaxation])
        self._times = np.array([term.time_constant for term in material.relaxation])
        count, terms = len(points.tangents(mesh, mesh.nodes)), len(self._times)
        none = np.zeros((count, 6))
        self.history = HistoryVariables(
            None, False, np.zeros((terms, count, 6)), none, np.zeros(count), none, none
        )
        self.rest()

    @classmethod
    def of(cls, setup: Setup, grid: Meshing, mesh: Mesh) -> Self | None:
        """Make the history of a block with this mesh specification, of which `mesh` is one.

        None for a material without history.
        """
        return (
            cls(setup, material_points(setup, grid, mesh), mesh)
            if setup.material.has_history
            else None
        )

    @property
    def fresh(self) -> bool:
        """Whether the tool was never in contact."""
        return not self.history.touched

    def rest(self) -> None:
        """Begin the long rest before the first frame, in which all stress relaxes that can."""
        none = np.zeros(len(self._times))
        self.step, self._time = TimeStep(none, none, 1 - float(self._shares.sum())), 0.0

    def start(self, rest: Equilibrium) -> None:
        """Start with a block that has long been at rest in this equilibrium."""
        self.history = replace(self.after(rest), time=None, delayed=self.history.delayed)

    def begin(self, time: float | None) -> None:
        """Begin the step to an instant [s]; the first instant follows the rest without delay."""
        if time is None or not math.isfinite(time):
            raise SetupError(
                "a material with history needs every frame, and the time of each: give `times`",
                key="times",
            )
        last = self.history.time
        if last is not None and not time > last:
            raise SetupError(
                f"frames come in the order of time; {time:g} s is not after {last:g} s",
                key="times",
                value=time,
            )
        spans = (0.0 if last is None else time - last) / self._times
        taken = self._shares * np.where(
            spans > 0, -np.expm1(-spans) / np.where(spans > 0, spans, 1.0), 1.0
        )
        factor = float(1 - self._shares.sum() + taken.sum())
        self.step, self._time = TimeStep(np.exp(-spans), taken, factor), float(time)

    def apply_to(self, model: BlockModel, positions: FloatArray | None = None) -> None:
        """Apply the step to a model; with positions (n, 3) [m], including the set that they
        cause.
        """
        past, step, mesh = self.history, self.step, model.mesh
        fixed = np.einsum("k,kmc->mc", step.left, past.delayed) - step.taken.sum() * past.driving
        history = past
        if positions is not None and self.fraction:
            history = self._set(cauchy_green(self.points.tangents(mesh, positions)))
        stress = self.points.read(mesh, fixed - step.factor * history.free)
        model.mu = step.factor * model.unrelaxed
        model.added_potential = ConstantStress.of(model, stress * model.unrelaxed[..., None])

    def _set(self, strained: FloatArray) -> HistoryVariables:
        """The history with the permanent set that these C (m, 6) cause."""
        past = self.history
        if not self.fraction:
            return past
        strain = log_strain(strained, past.largest)
        size = np.sqrt(np.einsum("mc,mc,c->m", strain, strain, [1, 1, 1, 2, 2, 2]))
        growing = size > past.largest
        longer, stored_strain, free = size[growing], past.stored_strain.copy(), past.free.copy()
        stored_strain[growing] += ((longer - past.largest[growing]) / longer)[:, None] * strain[
            growing
        ]
        free[growing] = shear_stress(
            self.law, from_log_strain(self.fraction * stored_strain[growing])
        )
        return replace(
            past, largest=np.maximum(size, past.largest), stored_strain=stored_strain, free=free
        )

    def after(self, frame: Equilibrium) -> HistoryVariables:
        """The history after a frame, at the end of the current step."""
        past, step = self.history, self.step
        strained = cauchy_green(
            self.points.tangents(frame.mesh, frame.mesh.nodes + frame.displacement)
        )
        result = self._set(strained)
        driving = shear_stress(self.law, strained) - result.free
        delayed = step.left[:, None, None] * past.delayed + step.taken[:, None, None] * (
            driving - past.driving
        )
        touched = past.touched or frame.in_contact
        return replace(result, time=self._time, touched=touched, delayed=delayed, driving=driving)

    def with_permanent_set(
        self,
        model: BlockModel,
        tool: ToolSphere | None,
        solution: Solution,
        tolerance: float,
        quick_solver: ModifiedNewton,
    ) -> Solution:
        """Find the equilibrium that is consistent with the permanent set it causes.

        Args:
            model: of the block.
            tool: stays where it is; None without a tool.
            solution: equilibrium under the earlier set.
            tolerance: relative residual.
            quick_solver: modified Newton method.
        """
        if not self.fraction:
            return solution
        iterations = solution.iterations
        for _ in range(_MOST_ROUNDS):
            if not solution.converged:
                return replace(solution, iterations=iterations)
            positions = solution.positions
            self.apply_to(model, positions)
            residual = relative_residual(model, model.assemble(positions, tool, tangent=False))
            if residual <= tolerance:
                return replace(solution, iterations=iterations, residual=residual)
            if tool is None:
                solution = solve(model, None, positions, None, tolerance)
            else:
                solution = move_tool(model, positions, tool, tool, tolerance, quick_solver)
            iterations += solution.iterations
        return replace(solution, iterations=iterations, outcome=Outcome.ITERATIONS)

    def end(self, frame: Equilibrium) -> None:
        """Store a frame.

        A frame without equilibrium changes nothing, and the next step begins where this one did.
        """
        if frame.outcome is Outcome.CONVERGED:
            self.history = self.after(frame)
