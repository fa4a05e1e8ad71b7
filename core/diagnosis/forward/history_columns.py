"""Patterns of what hangs on the past, for the screening: one linear solve for each group and
effect, and no replay.

A replay that remembers is led along the tool's whole way
(`palpate.diagnosis.forward.history_replay`), which costs many plain ones. Whether it is worth that
is told by its trace: the change that it would bring about, taken from the plain replay's
equilibria.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.friction_derivatives import Spot, pulls, spot_of
from palpate.diagnosis.forward.history_replay import TRACED
from palpate.diagnosis.forward.loading_history import LoadingHistory, loading_history_of
from palpate.diagnosis.forward.memory_derivatives import Recollection
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.ray_comparison import PointSample, averaging_matrix, compare
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.effects import Effect
from palpate.effects.tool import ToolFriction
from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import BlockModel
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.gradients.compliant_tool import tool_derivatives
from palpate.gradients.frame_tangent import factorise_at, local_tool
from palpate.measurement.surface_gaps import Surface
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = ["Trace", "moved", "moves", "traces_of", "with_traces"]


@dataclass(frozen=True, eq=False)
class Trace:
    """What an effect changes, to first order: measured minus simulated gaps (g, p) [m], and forces
    on the tool (g, 3) [N].
    """

    gap: FloatArray
    force: FloatArray

    def on(self, plain: Prediction) -> Prediction:
        """The plain prediction with the change in it."""
        forces = (
            None
            if plain.forces is None
            else replace(plain.forces, gap=plain.forces.gap + self.force)
        )
        return replace(plain, gap=plain.gap + self.gap, forces=forces)


@dataclass(frozen=True, eq=False)
class _Look:
    """One group: its frame, or the block without a tool on the grid of the last contact, and the
    model factorised there.
    """

    frame: Equilibrium
    model: BlockModel

    @cached_property
    def coupling(self) -> FloatArray:
        """How the residual changes with the tool's place (u, 3), over E [m]."""
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
    """One trace of each effect, of the size that it has.

    Args:
        setup: without a memory.
        frames: of its replay, one for each group.
        samples: the points that are averaged.
    """
    block, surface = Replay(setup, grid), Surface.of(setup)
    time = loading_history_of(data, setup, touch_correction(setup, grid), tuple(frames))
    rough = [effect for effect in effects if isinstance(effect, ToolFriction)]
    lasting = [effect for effect in effects if not isinstance(effect, ToolFriction)]
    past = Recollection(block, frames, time)
    lacks = {id(effect): past.lacks(effect) for effect in lasting}
    spots: dict[int, Spot | None] = {}
    shape, modulus = (len(frames), surface.patches), setup.material.young_modulus
    found = {id(effect): Trace(np.zeros(shape), np.zeros((len(frames), 3))) for effect in effects}
    kept: dict[int, tuple[_Look, Any]] = {}
    for number in past.order:
        group, touched = data.groups[number], number in time.touched
        missing = {name: stress for name, own in lacks.items() if (stress := next(own)) is not None}
        look = _look(block, frames, number, time) if touched or missing else None
        if look is None:
            continue
        seen = averaging_matrix(
            look.frame, compare(group, setup, look.frame, surface, samples[number])
        )
        answers = {
            name: look.model.topology.factor.approximate(
                past.load(look.model, stress, look.frame.displacement)
            )
            for name, stress in missing.items()
        }
        if touched and rough:
            spots[number] = spot_of(look.model, look.frame)
            kept[number] = (look, seen)
        for name, answer in answers.items():
            _state(found[name], number, look, seen, answer, modulus)
    held = [spots.get(number) for number in time.touched]
    for effect in rough:
        for pull, spot, number in zip(pulls(effect, time, held), held, time.touched, strict=True):
            if spot is not None and pull.any():
                look, seen = kept[number]
                _state(found[id(effect)], number, look, seen, spot.answer @ pull, modulus, pull)
    return [found[id(effect)] for effect in effects]


def _look(
    block: Replay, frames: Sequence[Equilibrium], number: int, time: LoadingHistory
) -> _Look | None:
    """None where no equilibrium, or no factor, is to be had."""
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


def _state(
    trace: Trace,
    number: int,
    look: _Look,
    seen: Any,
    answer: FloatArray,
    modulus: float,
    drag: FloatArray | float = 0.0,
) -> None:
    """Put what the answer (u,) [m] changes into a group's row; `drag` (3,) pulls at the block
    itself, over E [m^2].
    """
    change = np.zeros_like(look.frame.displacement)
    change[look.model.topology.free] = answer
    trace.gap[number] = -(seen @ change.ravel())
    if not look.frame.in_contact:
        return
    # Measured minus simulated force on the tool, which the coupling of the residual tells (see
    # `palpate.gradients.force_changes.force_changes`).
    trace.force[number] = modulus * (answer @ look.coupling + drag)


def moved(effect: Effect, number: int) -> tuple[Effect, float]:
    """With one search coordinate a step further, and the step."""
    item, coordinates = effect.numbers()[number], effect.coordinates
    step = CRITERIA.history.trace_step * item.scale
    step = -step if coordinates[number] + step > item.coordinate(item.high) else step
    coordinates[number] += step
    return effect.at(coordinates), step


def moves(effects: Sequence[Effect]) -> list[Effect]:
    """Those of the effects that are traced, each followed by itself with every number a step
    further.
    """
    found = []
    for effect in effects:
        if isinstance(effect, TRACED):
            found += [
                effect,
                *(moved(effect, number)[0] for number in range(len(effect.numbers()))),
            ]
    return found


def with_traces(
    led: Prediction,
    plain: Prediction,
    traces: Sequence[Trace],
    effects: Sequence[Effect],
    first: int,
    extra: int,
) -> Prediction:
    """A replay along the whole way with columns: those of the plain replay, and of traced effects
    the differences of their traces.

    Args:
        plain: without the traced effects, whose columns have those of the other effects from
            `first` on, and then the extra ones.
        traces: of `moves(effects)`.
        extra: how many of them to keep.
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
        if not isinstance(effect, TRACED):
            parts.append(columns[..., at : at + count])
            at += count
            continue
        whole = whole + traces[own].gap
        steps = [moved(effect, number)[1] for number in range(count)]
        parts.append(
            np.stack(
                [(rows[own + 1 + n] - rows[own]) / step for n, step in enumerate(steps)], axis=-1
            )
        )
        own += 1 + count
    changed = led.change_from(plain)[0]
    if whole.any():
        scale = float(
            np.clip(
                np.sum(led.count * changed * whole) / np.sum(led.count * whole**2),
                CRITERIA.history.least_trace_scale,
                CRITERIA.history.most_trace_scale,
            )
        )
    for place, effect in enumerate(effects):
        parts[1 + place] = parts[1 + place] * (scale if isinstance(effect, TRACED) else 1.0)
    return led.replace_columns(np.concatenate([*parts, columns[..., at : at + extra]], axis=2))
