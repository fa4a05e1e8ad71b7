"""Signatures: the changes by effects that are screened at a finite size."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.effects import Effect, Linearisation, Slot
from palpate.effects.geometry import DIAGNOSIS_GRID
from palpate.mesh.protocol import Meshing

__all__ = ["Signature", "replayed_signatures", "signatures_of", "updated_signatures"]

Signature = tuple[Effect, list[Prediction]]
"""An effect of a finite size, and every sequence predicted with it."""


def signatures_of(evaluator: Evaluator, baseline: Model) -> list[Signature]:
    """Return the signatures of the applicable effects that have no tangent.

    They are differences of two replays on a coarse mesh, or first-order traces of effects with
    history. The grid of the diagnosis is one more where the setup states another.
    """
    state = evaluator.state
    starts = _starts(evaluator, Linearisation.FINITE_DIFFERENCE)
    found: list[Signature] = []
    if state.on_diagnosis_grid:
        found = [(DIAGNOSIS_GRID, [one.without_details() for one in state.on_diagnosis_grid])]
    return [
        *found,
        *replayed_signatures(evaluator, baseline, starts, baseline),
        *_traced(evaluator, baseline),
    ]


def _starts(evaluator: Evaluator, linearisation: Linearisation) -> list[Effect]:
    problem = evaluator.problem
    return [
        effect
        for kind in problem.applicable
        if kind.linearisation is linearisation
        for effect in kind.starts(problem.setup)
    ]


def updated_signatures(
    evaluator: Evaluator, model: Model, signatures: Sequence[Signature], origin: Model
) -> list[Signature]:
    """Return signatures for use on top of a model, those that depend on it made anew.

    A load depends on everything that shapes a push, as a block that sags is met later. Measured:
    with its signature under a tool of 6 mm, gravity had a linear gain of -4 nats on top of a tool
    of 3.7 mm, and 303 with its own. Supports depend on loads: a block that may slide sags in
    another way, and its weight presses it on the table (350 and 1255 nats).

    Args:
        evaluator: of the inference problem.
        model: with the causes found so far.
        signatures: over `origin`.
        origin: the baseline.
    """
    slots = [Slot.LOAD] if model.effects else []
    if any(effect.enters is Slot.LOAD for effect in model.effects):
        slots.append(Slot.SUPPORT)
    starts = [
        effect
        for effect, _ in signatures
        if effect.linearisation is Linearisation.FINITE_DIFFERENCE
        and effect.enters in slots
        and effect.name not in model.names
    ]
    if not starts:
        return list(signatures)
    anew = dict(replayed_signatures(evaluator, model, starts, origin))
    return [(effect, anew.get(effect, predictions)) for effect, predictions in signatures]


def replayed_signatures(
    evaluator: Evaluator, model: Model, starts: Sequence[Effect], origin: Model
) -> list[Signature]:
    """Return the changes of a model by these effects, added to the predictions of `origin`."""
    problem, coarse = evaluator.problem, list[Prediction]()
    meshes = [_mesh_for(effect, evaluator) for effect in starts]
    if any(mesh is not problem.grid for mesh in meshes):
        coarse = evaluator.replayed(model.effects, model.predictions, problem.coarse_grid)
    known = [model.predictions if mesh is problem.grid else coarse for mesh in meshes]
    tolerance = CRITERIA.replay.screening_tolerance
    pending = [
        evaluator.predict([*model.effects, effect], None, without, mesh, tolerance)
        for effect, without, mesh in zip(starts, known, meshes, strict=True)
    ]
    found: list[Signature] = []
    for number, (effect, without, futures) in enumerate(zip(starts, known, pending, strict=True)):
        evaluator.report(f"what {effect.name} would do", 0.15 + 0.25 * number / len(pending))
        changed = [future.result() for future in futures]
        rows = zip(origin.predictions, changed, without, strict=True)
        moved = [other.transferred(here, zero) for here, other, zero in rows]
        found.append((effect, [item.without_details() for item in moved]))
    return found


def _traced(evaluator: Evaluator, baseline: Model) -> list[Signature]:
    """Return the first-order changes by effects with history.

    They cost a few linear solves for each group (see `palpate.diagnosis.forward.history_columns`).
    Sequences without clouds have none: short pushes leave nothing behind that forces show.
    """
    problem = evaluator.problem
    if any(item.force_only for item in baseline.predictions):
        return []
    starts = _starts(evaluator, Linearisation.HISTORY)
    if not starts:
        return []
    evaluator.report("what the material or the tool would remember", 0.4)
    pending = evaluator.workers.trace(
        problem.names, baseline.setup, problem.grid, baseline.predictions, starts
    )
    traces = [future.result() for future in pending]
    rows = list(zip(traces, baseline.predictions, strict=True))
    return [
        (effect, [own[number].on(plain).without_details() for own, plain in rows])
        for number, effect in enumerate(starts)
    ]


def _mesh_for(effect: Effect, evaluator: Evaluator) -> Meshing:
    problem = evaluator.problem
    return problem.grid if effect.needs_fine_mesh else problem.coarse_grid
