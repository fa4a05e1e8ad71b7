"""The last fits of a model: with replayed columns, and with the mesh error of the model itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator, SharedEvaluator
from palpate.diagnosis.inference.evaluate_history import with_replayed_columns
from palpate.diagnosis.inference.gauss_newton import best_fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.effects import Effect, Tangent
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import AnyInclusion

__all__ = ["refine", "settle", "with_columns_of"]


def refine(evaluator: Evaluator, model: Model) -> Model:
    """Fit an accepted model once more, with the mesh error of this model and shared nuisances held.

    Its log evidence no longer compares with that of models scored before. The mesh error of effects
    with history, whose replay on a fine mesh is expensive, is taken to be that of a replay without
    them.
    """
    problem, state = evaluator.problem, evaluator.state
    evaluator.report("fitting the causes once more on two meshes")
    plain = tuple(effect for effect in model.effects if not effect.has_history())
    if plain:
        here = (
            model.predictions
            if plain == model.effects
            else evaluator.evaluate(plain, model.predictions).predictions
        )
        fine = evaluator.replayed(plain, here, problem.fine_grid)
        state.noises = [
            noise.remeshed(coarse, finer)
            for noise, coarse, finer in zip(state.noises, here, fine, strict=True)
        ]
    start = evaluator.assemble(model.effects, model.setup, model.predictions)
    held = problem.nuisances.with_effects(start.effects)
    if model.has_history:
        return _settled_once(evaluator, start, held)
    return best_fit(evaluator, start, held, worth=CRITERIA.fits.settled)


def settle(evaluator: Evaluator, model: Model, nuisances: FloatArray, worth: float) -> Model:
    """Fit a model with history further, by columns that are replayed along the tool's path.

    The columns of `Evaluator.evaluate` for effects without history are those of replays without
    history. Measured, for a tool that is 2 mm off beside viscoelasticity: their correlation with
    the replayed ones is 0.63 to 0.9, and a fit by them ends 1100 nats short of the best. A model
    whose effects all have history is returned as it is.

    Args:
        evaluator: of the inference problem.
        model: with history, fitted by the columns of `Evaluator.evaluate`.
        nuisances: prior precision of the nuisances.
        worth: a step that promises less [nats] is not made.
    """
    chosen = [not effect.has_history() for effect in model.effects]
    for _ in range(CRITERIA.history.replayed_columns if any(chosen) else 0):
        start = _with_replayed_columns(evaluator, model, chosen)
        model = best_fit(_HeldColumns(evaluator, start, chosen), start, nuisances, worth=worth)
        gained = evaluator.objective(model, nuisances) - evaluator.objective(start, nuisances)
        if gained < CRITERIA.history.replayed_again:
            break
    return model


def _settled_once(evaluator: Evaluator, model: Model, nuisances: FloatArray) -> Model:
    """Return the model after a fit by replayed columns of all its effects, which it keeps."""
    every = [True] * len(model.effects)
    start = _with_replayed_columns(evaluator, model, every)
    held = _HeldColumns(evaluator, start, every)
    return best_fit(held, start, nuisances, worth=CRITERIA.fits.settled)


def _with_replayed_columns(evaluator: Evaluator, model: Model, chosen: Sequence[bool]) -> Model:
    """Return the model with columns of the chosen effects from replays along the tool's path."""
    evaluator.report(f"replaying what changes {' and '.join(model.names)}")
    starts = model.predictions
    found = with_replayed_columns(evaluator, model.effects, starts, starts, chosen)
    return evaluator.assemble(model.effects, model.setup, found)


class _HeldColumns(SharedEvaluator):
    """Evaluates models near one whose columns of effects are held.

    Args:
        evaluator: of the inference problem.
        model: whose columns are held.
        chosen: whether the columns of each effect are held.
    """

    def __init__(self, evaluator: Evaluator, model: Model, chosen: Sequence[bool]) -> None:
        super().__init__(evaluator)
        self._model = model
        counts = [len(effect.numbers()) for effect in model.effects]
        self._held = [
            column
            for column, held in zip(model.columns, np.repeat(chosen, counts), strict=True)
            if held
        ]

    def evaluate(
        self,
        effects: Sequence[Effect],
        starts: Sequence[Prediction] | None = None,
        tangents: Sequence[Tangent] = (),
        inclusions: Sequence[AnyInclusion] = (),
    ) -> Model:
        """Replay the effects; arguments as for `Evaluator.evaluate`."""
        model = self._told.evaluate(effects, starts, tangents, inclusions)
        return with_columns_of(self, model, self._model, self._held, len(inclusions))


def with_columns_of(
    evaluator: Evaluator, model: Model, other: Model, places: Sequence[int], inclusions: int = 0
) -> Model:
    """Return a model with some columns of another model of the same effects.

    Args:
        evaluator: of the inference problem.
        model: whose columns are replaced.
        other: whose columns are taken.
        places: of the columns.
        inclusions: number of places of inclusions among the columns of `model`.
    """
    rows = zip(model.predictions, other.predictions, strict=True)
    found = [_with_columns(here, there, list(places)) for here, there in rows]
    return evaluator.assemble(model.effects, model.setup, found, model.tangents, inclusions)


def _with_columns(here: Prediction, there: Prediction, places: list[int]) -> Prediction:
    """Return a prediction with some columns of another one."""
    columns = here.columns.copy()
    columns[..., places] = there.columns[..., places]
    forces = here.forces
    if forces is not None and there.forces is not None:
        own = forces.columns.copy()
        own[..., places] = there.forces.columns[..., places]
        forces = replace(forces, columns=own)
    return replace(here, columns=columns, forces=forces)
