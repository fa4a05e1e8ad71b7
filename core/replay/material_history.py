"""What a material remembers of its past: relaxation, and strain that stays. Both act on the shear stress; the pressure is elastic.

Finite linear viscoelasticity (Simo 1987; Holzapfel 2000, sec. 6.10): with S the second Piola-Kirchhoff shear stress of the elastic
law, fibres included, T that of the strain that stays, and a Prony series of shares g_i and time constants tau_i,

    stress = pressure + (1 - sum g_i) (S - T) + sum h_i,    h_i' + h_i / tau_i = g_i (S - T)'

so E is the modulus of a motion faster than any tau. Over a step of length t in which S - T changes evenly the solution is exact,
h_i <- e^(-t/tau_i) h_i + g_i r_i (change of S - T) with r_i = (1 - e^(-t/tau_i)) tau_i / t (Taylor, Pister and Goudreau 1970),
however long the step; what the strain did between two frames other than to change evenly is lost. In a step the new stress is a
multiple of S and a part that the past has fixed (`palpate.fem.history_stress`), which keeps the direction it had in the body while the strain
goes on: a pressure of second order in the strain's change, that a stiff bulk hides.

Permanent set: with L the logarithmic strain without the part in the volume, a point keeps a strain M that grows along L by as
much as |L| exceeds the largest there was (backward Euler from frame to frame). The share of M that is retained is free of stress: a
bar stretched to l, its volume kept, and let go stays at l^share. The set is there at once, so a first push is softer than a second
by about that share; the second changes nothing unless it goes further. There is no strain below which none is kept, and none creeps
back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.fem.constitutive.elastic import Law
from palpate.fem.continuation import move_tool
from palpate.fem.history_stress import (
    ConstantStress,
    cauchy_green,
    from_log_strain,
    log_strain,
    shear_stress,
)
from palpate.fem.material_points import MaterialPoints, material_points
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import Outcome, Solution, relative_residual, solve
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Material, Setup

__all__ = ["HistoryVariables", "MaterialHistory", "ReplayState", "TimeStep", "require_memoryless"]

_MOST_ROUNDS = 100
"""Equilibria in one frame until one brings its own set: each leaves about the retained share of
what the last one missed by."""


@dataclass(frozen=True, eq=False)
class HistoryVariables:
    """What is remembered after a frame, at the material's points; stresses are over the local shear
    modulus [1].

    Attributes:
        time: of the frame [s]; None before the first.
        touched: whether the tool was ever in contact.
        delayed: (k, m, 6) h of each term.
        driving: (m, 6) S - T.
        largest: (m,) |L|.
        kept: (m, 6) M.
        free: (m, 6) T.
    """

    time: float | None
    touched: bool
    delayed: FloatArray
    driving: FloatArray
    largest: FloatArray
    kept: FloatArray
    free: FloatArray


@dataclass(frozen=True, eq=False)
class ReplayState:
    """From where a replay can go on: its last frame, and what the material remembers then; None for
    one without memory.
    """

    frame: Equilibrium
    history: HistoryVariables | None


@dataclass(frozen=True, eq=False)
class TimeStep:
    """One step in time: what is left of each h (k,), what it takes from the change of S - T (k,),
    and S's factor in the stress.
    """

    left: FloatArray
    taken: FloatArray
    factor: float


def require_memoryless(material: Material, what: str) -> None:
    """Raise SetupError that says what knows nothing of the past, when the material remembers it."""
    if material.has_history:
        key = "relaxation" if material.relaxation else "retained_fraction"
        raise SetupError(f"{what} leave out the material's {key}", key=key)


class MaterialHistory:
    """The memory of one block: `begin` a step in time, let the models `recall`, and `end` it with
    what was found.

    Attributes:
        history: as of the last frame that was an equilibrium; before the first, that of a block
            which has long been at rest.
        step: the one that is under way.
        law, points, fraction: what S is by, where it is remembered, and what of M is retained.
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
        """For a block on such a grid, of which this mesh is one; None for a material without
        memory.
        """
        return (
            cls(setup, material_points(setup, grid, mesh), mesh)
            if setup.material.has_history
            else None
        )

    @property
    def fresh(self) -> bool:
        """Whether the tool was never there."""
        return not self.history.touched

    def rest(self) -> None:
        """Set out for the long rest before the first frame, in which all relaxes that can."""
        none = np.zeros(len(self._times))
        self.step, self._time = TimeStep(none, none, 1 - float(self._shares.sum())), 0.0

    def start(self, rest: Equilibrium) -> None:
        """Begin with a block that has long been at rest like this."""
        self.history = replace(self.after(rest), time=None, delayed=self.history.delayed)

    def begin(self, time: float | None) -> None:
        """Set out for an instant [s]; the first one is reached at once from rest."""
        if time is None or not math.isfinite(time):
            raise SetupError(
                "a material with memory needs every frame, and the time of each: give `times`",
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
        """Put the step into a model; with positions (n, 3) [m], with the set that they bring."""
        past, step, mesh = self.history, self.step, model.mesh
        fixed = np.einsum("k,kmc->mc", step.left, past.delayed) - step.taken.sum() * past.driving
        kept = past
        if positions is not None and self.fraction:
            kept = self._set(cauchy_green(self.points.tangents(mesh, positions)))
        stress = self.points.read(mesh, fixed - step.factor * kept.free)
        model.mu = step.factor * model.unrelaxed
        model.added_potential = ConstantStress.of(model, stress * model.unrelaxed[..., None])

    def _set(self, strained: FloatArray) -> HistoryVariables:
        """The history with the set that these C (m, 6) bring."""
        past = self.history
        if not self.fraction:
            return past
        strain = log_strain(strained, past.largest)
        size = np.sqrt(np.einsum("mc,mc,c->m", strain, strain, [1, 1, 1, 2, 2, 2]))
        growing = size > past.largest
        longer, kept, free = size[growing], past.kept.copy(), past.free.copy()
        kept[growing] += ((longer - past.largest[growing]) / longer)[:, None] * strain[growing]
        free[growing] = shear_stress(self.law, from_log_strain(self.fraction * kept[growing]))
        return replace(past, largest=np.maximum(size, past.largest), kept=kept, free=free)

    def after(self, frame: Equilibrium) -> HistoryVariables:
        """The history with a frame in it, at the end of the step that is under way."""
        past, step = self.history, self.step
        strained = cauchy_green(
            self.points.tangents(frame.mesh, frame.mesh.nodes + frame.displacement)
        )
        found = self._set(strained)
        driving = shear_stress(self.law, strained) - found.free
        delayed = step.left[:, None, None] * past.delayed + step.taken[:, None, None] * (
            driving - past.driving
        )
        touched = past.touched or frame.in_contact
        return replace(found, time=self._time, touched=touched, delayed=delayed, driving=driving)

    def with_permanent_set(
        self,
        model: BlockModel,
        tool: ToolSphere | None,
        solution: Solution,
        tolerance: float,
        quick_solver: ModifiedNewton,
    ) -> Solution:
        """The equilibrium that brings its own set, from one under the set that was, with the tool
        where it is.
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
        """Remember a frame; one that is no equilibrium leaves everything as it was, and the next
        step begins where this one did.
        """
        if frame.outcome is Outcome.CONVERGED:
            self.history = self.after(frame)
