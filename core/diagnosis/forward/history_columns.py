"""First-order changes by effects with history: one linear solve for each group and effect.

A replay with history follows the tool's whole path (`palpate.diagnosis.forward.history_replay`),
which costs as much as many plain replays. The screening uses its trace instead: the first-order
change, derived from the equilibria of the plain replay. The material's history and the tool's
friction follow from the setup with the effect in it, so that any effect that changes them has a
trace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.friction_derivatives import ContactSpot, pulls, spot_of
from palpate.diagnosis.forward.loading_history import LoadingHistory, loading_history_of
from palpate.diagnosis.forward.memory_derivatives import StressHistory
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.ray_comparison import PointSample, averaging_matrix, compare
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.effects import Effect
from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import BlockModel
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.gradients.compliant_tool import tool_derivatives
from palpate.gradients.frame_tangent import factorise_at, local_tool
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = [
    "Trace",
    "changes_tool_friction",
    "perturbed",
    "perturbed_effects",
    "traces_of",
    "with_history_columns",
]


@dataclass(frozen=True, eq=False)
class Trace:
    """The first-order change by an effect.

    Attributes:
        gap: change of measured minus simulated gaps (g, p) [m].
        force: change of measured minus simulated forces on the tool (g, 3) [N].
    """

    gap: FloatArray
    force: FloatArray

    def on(self, plain: Prediction) -> Prediction:
        """Return the plain prediction with the change in it."""
        forces = (
            None
            if plain.forces is None
            else replace(plain.forces, gap=plain.forces.gap + self.force)
        )
        return replace(plain, gap=plain.gap + self.gap, forces=forces)


@dataclass(frozen=True, eq=False)
class _Look:
    """The tangent of one group: its frame, and the model factorised there.

    Without contact the frame is that of the block without a tool, on the grid of the last contact.
    """

    frame: Equilibrium
    model: BlockModel

    @cached_property
    def coupling(self) -> FloatArray:
        """Derivative of the residual by the tool's position (u, 3), over E [m]."""
        return tool_derivatives(
            self.model, self.frame.mesh.nodes + self.frame.displacement, local_tool(self.frame)
        )[0]


def traces_of(
    data: Observations,
    setup: Setup,
    grid: Meshing,
    frames: Sequence[Equilibrium],
    samples: Sequence[PointSample],
    effects: Sequence[Effect],
) -> list[Trace]:
    """Return the trace of each effect, at the size that it has.

    Args:
        data: the sequence.
        setup: without history.
        grid: mesh.
        frames: of the replay of this setup, one for each group.
        samples: the points that are averaged.
        effects: with history.
    """
    block, surface = Replay(setup, grid), setup.surface()
    time = loading_history_of(data, setup, touch_correction(setup, grid), tuple(frames))
    past = StressHistory(block, frames, time)
    losses = [past.stress_losses(effect.apply(setup)) for effect in effects]
    frictions = {
        row: effect.apply(setup).tool.friction_coefficient
        for row, effect in enumerate(effects)
        if changes_tool_friction(effect, setup)
    }
    spots: dict[int, ContactSpot | None] = {}
    shape, modulus = (len(frames), surface.patches), setup.material.young_modulus
    traces = [Trace(np.zeros(shape), np.zeros((len(frames), 3))) for _ in effects]
    stored: dict[int, tuple[_Look, Any]] = {}
    for number in past.order:
        group, touched = data.groups[number], number in time.touched
        missing = {
            row: stress for row, own in enumerate(losses) if (stress := next(own)) is not None
        }
        look = _look(block, frames, number, time) if touched or missing else None
        if look is None:
            continue
        seen = averaging_matrix(
            look.frame, compare(group, setup, look.frame, surface, samples[number])
        )
        answers = {
            row: look.model.topology.factor.approximate(
                past.load(look.model, stress, look.frame.displacement)
            )
            for row, stress in missing.items()
        }
        if touched and frictions:
            spots[number] = spot_of(look.model, look.frame)
            stored[number] = (look, seen)
        for row, answer in answers.items():
            _add(traces[row], number, look, seen, answer, modulus)
    held = [spots.get(number) for number in time.touched]
    for row, friction in frictions.items():
        for pull, spot, number in zip(pulls(friction, time, held), held, time.touched, strict=True):
            if spot is not None and pull.any():
                look, seen = stored[number]
                _add(traces[row], number, look, seen, spot.answer @ pull, modulus, pull)
    return traces


def changes_tool_friction(effect: Effect, setup: Setup) -> bool:
    """Return whether the effect changes the friction between tool and surface in this setup."""
    return effect.apply(setup).tool.friction_coefficient != setup.tool.friction_coefficient


def _look(
    block: Replay, frames: Sequence[Equilibrium], number: int, time: LoadingHistory
) -> _Look | None:
    """Return the tangent of a group; None without an equilibrium, or without a factor."""
    frame = frames[number]
    if frame.outcome is not Outcome.CONVERGED:
        return None
    if frame.in_contact:
        model = factorise_at(block, frame)
        return None if model is None else _Look(frame, model)
    before = [other for other in time.touched if time.instants[other] <= time.instants[number]]
    mesh = frames[before[-1]].mesh if before else frame.mesh
    still = replace(
        frame, mesh=mesh, displacement=frame.mesh.interpolate(frame.displacement, mesh.nodes)
    )
    model = block.model(mesh)
    try:
        model.factorise(model.assemble(mesh.nodes + still.displacement, None).data)
    except NotPositiveDefinite:
        return None
    return _Look(still, model)


def _add(
    trace: Trace,
    number: int,
    look: _Look,
    seen: Any,
    answer: FloatArray,
    modulus: float,
    drag: FloatArray | float = 0.0,
) -> None:
    """Add a change to a group's row of a trace.

    Args:
        trace: to be changed.
        number: of the group.
        look: tangent of the group.
        seen: averages of the points by patch, as a matrix.
        answer: displacement of the unknowns (u,) [m].
        modulus: Young's modulus [Pa].
        drag: on the block, over E (3,) [m^2].
    """
    change = np.zeros_like(look.frame.displacement)
    change[look.model.topology.free] = answer
    trace.gap[number] -= seen @ change.ravel()
    if not look.frame.in_contact:
        return
    # The force on the tool follows from the coupling of the residual
    # (see `palpate.gradients.force_changes.force_changes`).
    trace.force[number] += modulus * (answer @ look.coupling + drag)


def perturbed(effect: Effect, number: int) -> tuple[Effect, float]:
    """Return the effect with one search coordinate a step further, and the step."""
    item, coordinates = effect.numbers()[number], effect.coordinates
    step = CRITERIA.history.trace_step * item.scale
    step = -step if coordinates[number] + step > item.coordinate(item.high) else step
    coordinates[number] += step
    return effect.at(coordinates), step


def perturbed_effects(effects: Sequence[Effect]) -> list[Effect]:
    """Return the effects with history, each followed by itself with every number a step further."""
    found = []
    for effect in effects:
        if effect.has_history():
            found += [
                effect,
                *(perturbed(effect, number)[0] for number in range(len(effect.numbers()))),
            ]
    return found


def with_history_columns(
    replayed: Prediction,
    plain: Prediction,
    traces: Sequence[Trace],
    effects: Sequence[Effect],
    first: int,
    extra: int,
) -> Prediction:
    """Return a replay along the tool's path with columns.

    They are those of the plain replay, and for effects with history the differences of traces.

    Args:
        replayed: along the path.
        plain: without the effects with history.
        traces: of `perturbed_effects(effects)`.
        effects: of the model.
        first: column of the first effect without history in `plain`.
        extra: number of columns of `plain` after those of the effects, which are used too.
    """
    columns = (
        plain.columns
        if plain.forces is None
        else np.concatenate([plain.columns, plain.forces.columns], axis=1)
    )
    rows = [
        trace.gap if plain.forces is None else np.concatenate([trace.gap, trace.force], axis=1)
        for trace in traces
    ]
    parts, own, at = [columns[..., :first]], 0, first
    whole, scale = np.zeros_like(plain.gap), 1.0
    for effect in effects:
        count = len(effect.numbers())
        if not effect.has_history():
            parts.append(columns[..., at : at + count])
            at += count
            continue
        whole = whole + traces[own].gap
        steps = [perturbed(effect, number)[1] for number in range(count)]
        parts.append(
            np.stack(
                [(rows[own + 1 + n] - rows[own]) / step for n, step in enumerate(steps)], axis=-1
            )
        )
        own += 1 + count
    changed = replayed.change_from(plain)[0]
    if whole.any():
        scale = float(
            np.clip(
                np.sum(replayed.count * changed * whole) / np.sum(replayed.count * whole**2),
                CRITERIA.history.least_trace_scale,
                CRITERIA.history.most_trace_scale,
            )
        )
    for place, effect in enumerate(effects):
        parts[1 + place] = parts[1 + place] * (scale if effect.has_history() else 1.0)
    return replayed.replace_columns(np.concatenate([*parts, columns[..., at : at + extra]], axis=2))
