"""The last fit of an accepted model, with the mesh error of this model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.gauss_newton import best_fit
from palpate.diagnosis.inference.hypothesis import Model

if TYPE_CHECKING:
    from palpate.diagnosis.inference.evaluate import Evaluator

__all__ = ["refine"]


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
    return best_fit(evaluator, start, held, worth=CRITERIA.fits.settled)
