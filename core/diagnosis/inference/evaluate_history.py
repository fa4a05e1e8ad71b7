"""Predictions of hypotheses in which a frame depends on the frames before it.

Such a hypothesis is replayed along the tool's whole path once. Its columns are first-order changes
from a replay without history. The column of tool friction comes from one more replay along the
path: to first order it is known how far the tool drags the surface, but not which part of the
contact slips first. Measured: the first-order column has a correlation of less than 0.85 with the
true one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.diagnosis.forward.history_columns import (
    changes_tool_friction,
    perturbed,
    perturbed_effects,
    with_history_columns,
)
from palpate.diagnosis.forward.prediction import Prediction
from palpate.effects import Effect, Tangent
from palpate.setup.setup import AnyInclusion

if TYPE_CHECKING:
    from palpate.diagnosis.inference.evaluate import Evaluator
    from palpate.diagnosis.inference.hypothesis import Model

__all__ = ["history_predictions", "plain_model", "with_replayed_columns"]


def history_predictions(
    evaluator: Evaluator,
    effects: Sequence[Effect],
    starts: Sequence[Prediction] | None,
    tangents: Sequence[Tangent],
    inclusions: Sequence[AnyInclusion],
) -> list[Prediction]:
    """Return predictions along the tool's path with their columns; arguments as for `evaluate`."""
    problem = evaluator.problem
    pending = evaluator.predict(effects, None, starts)
    plain = plain_model(evaluator, effects, starts, tangents, inclusions)
    traces = evaluator.workers.trace(
        problem.names, plain.setup, problem.grid, plain.predictions, perturbed_effects(effects)
    )
    first, extra = problem.blocks.replayed, len(tangents) + len(inclusions)
    rows = zip(evaluator.finished(pending), plain.predictions, traces, strict=True)
    predictions = [
        with_history_columns(one, base, own.result(), effects, first, extra)
        for one, base, own in rows
    ]
    rough = [
        effect.has_history() and changes_tool_friction(effect, plain.setup) for effect in effects
    ]
    return with_replayed_columns(evaluator, effects, predictions, starts, rough)


def with_replayed_columns(
    evaluator: Evaluator,
    effects: Sequence[Effect],
    predictions: Sequence[Prediction],
    starts: Sequence[Prediction] | None,
    chosen: Sequence[bool],
) -> list[Prediction]:
    """Return predictions whose columns of some effects are differences of two replays along the
    tool's path.

    Args:
        evaluator: of the inference problem.
        effects: of the model.
        predictions: of these effects, with columns.
        starts: predictions to begin from, one for each sequence.
        chosen: whether the columns of each effect are replaced.
    """
    found, column = list(predictions), evaluator.problem.blocks.replayed
    for index, effect in enumerate(effects):
        for number in range(len(effect.numbers())):
            if chosen[index]:
                other, step = perturbed(effect, number)
                changed = [*effects[:index], other, *effects[index + 1 :]]
                replays = evaluator.replayed(changed, starts)
                rows = zip(found, replays, strict=True)
                found = [here.replace_column(there, column, step) for here, there in rows]
            column += 1
    return found


def plain_model(
    evaluator: Evaluator,
    effects: Sequence[Effect],
    starts: Sequence[Prediction] | None,
    tangents: Sequence[Tangent] = (),
    inclusions: Sequence[AnyInclusion] = (),
) -> Model:
    """Return the model of the effects without history, which is reused from one fit to the next.

    Arguments as for `evaluate`.
    """
    others = tuple(effect for effect in effects if not effect.has_history())
    if not (tangents or inclusions):
        for model in evaluator.state.recent:
            if model.effects == others:
                return model
    return evaluator.evaluate(others, starts, tangents, inclusions)
