"""Parameters of a named cause that the data determine, bound, or tie to others.

The Fisher information with the nuisances integrated out is the screen: a parameter that it knows to
within a step that matters has its interval. The others get a profile likelihood (Raue et al. 2009):
the evidence a few deviations to either side, replayed there, with the other parameters moved to
where the linearised fit has them. A side on which the evidence does not fall is open.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import rows_of
from palpate.effects import Parameter
from palpate.effects.base import with_effects
from palpate.foundation.arrays import FloatArray

__all__ = ["Profile", "combination", "profile", "profiles", "vague"]


@dataclass(frozen=True)
class Profile:
    """Result for one parameter.

    Attributes:
        told: "interval", "at least", "at most" or "not identifiable".
        evaluations: number of replays of all sequences.
    """

    told: str
    evaluations: int


def profile(
    evidence: Callable[[FloatArray], float],
    at: FloatArray,
    covariance: FloatArray,
    index: int,
    item: Parameter,
) -> Profile:
    """Look to both sides of one coordinate.

    Args:
        evidence: of search coordinates (n,) [nats].
        at: the best coordinates (n,).
        covariance: of the linearised fit there (n, n).
        index: of the coordinate.
        item: the parameter, with its bounds.
    """
    best, deviation = evidence(at), float(np.sqrt(covariance[index, index]))
    along, used = covariance[:, index] / covariance[index, index], 0
    closed = []
    for sign, end in zip((-1.0, 1.0), item.ends, strict=True):
        # What comes round is farthest off at half a turn.
        room = (item.high - item.low) / 2 if item.periodic else abs(end - at[index])
        falls = False
        for far in dict.fromkeys(
            min(reach * deviation, room)
            for reach in (CRITERIA.verdict.profile_near, CRITERIA.verdict.profile_far)
        ):
            used += 1
            falls = best - evidence(at + sign * far * along) >= CRITERIA.verdict.profile_fall
            if falls:
                break
        closed.append(falls)
    told = {(True, True): "interval", (True, False): "at least", (False, True): "at most"}
    return Profile(told.get((closed[0], closed[1]), "not identifiable"), used)


def vague(covariance: FloatArray, items: Sequence[Parameter]) -> list[int]:
    """Return the coordinates that the linearised fit does not know to a step that matters, worst
    first.
    """
    widths = (
        CRITERIA.intervals.normal_quantile
        * np.sqrt(np.diag(covariance))
        / np.array([item.scale for item in items])
    )
    return [int(index) for index in np.argsort(-widths) if widths[index] > CRITERIA.verdict.vague]


def combination(covariance: FloatArray, items: Sequence[Parameter], index: int) -> str:
    """Return in words the direction through one coordinate in which the data know least.

    It is empty where the direction is that coordinate alone.
    """
    scales = np.array([item.scale for item in items])
    values, vectors = np.linalg.eigh(covariance / np.outer(scales, scales))
    weights = values * vectors[index] ** 2
    weakest = vectors[:, int(weights.argmax())]
    weakest = weakest * np.sign(weakest[index])
    parts = [
        n
        for n in np.argsort(-np.abs(weakest))
        if abs(weakest[n]) > CRITERIA.verdict.takes_part and n != index
    ]
    if not parts:
        return ""
    ways = [f"{items[n].name} {'grows' if weakest[n] > 0 else 'falls'}" for n in parts]
    return f"the data look the same while {items[index].name} grows and {' and '.join(ways)}"


def _settled(evaluator: Evaluator, model: Model) -> tuple[FloatArray, FloatArray]:
    """Return the prior precision of the nuisances, and the covariance (n, n) of the model's
    coordinates.
    """
    nuisances = evaluator.problem.nuisances.with_effects(model.effects)
    solution = fit(
        evaluator.tempered(model),
        [*model.nuisance, *model.columns],
        evaluator.precision(model, nuisances),
    )
    return nuisances, solution.covariance[len(model.nuisance) :, len(model.nuisance) :]


def _evidence(
    evaluator: Evaluator, model: Model, nuisances: FloatArray
) -> Callable[[FloatArray], float]:
    """Return the evidence as a function of the coordinates, with the nuisances' columns fixed."""

    def value(coordinates: FloatArray) -> float:
        effects = model.effects_at(coordinates)
        if np.array_equal(coordinates, model.coordinates):
            return evaluator.objective(model, nuisances)
        replayed = evaluator.replayed(effects, model.predictions)
        moved = [
            there.replace_columns(rows_of(here)[1])
            for here, there in zip(model.predictions, replayed, strict=True)
        ]
        setup = with_effects(evaluator.problem.setup, effects)
        return evaluator.objective(evaluator.assemble(effects, setup, moved), nuisances)

    return value


def profiles(
    evaluator: Evaluator, model: Model
) -> tuple[list[dict[str, str]], list[dict[str, Any]]]:
    """Return for each effect a mapping from parameter to verdict, and rows of the report.

    The rows are those of parameters that no data of this kind determine.
    """
    nuisances, covariance = _settled(evaluator, model)
    items = [item for effect in model.effects for item in effect.numbers()]
    names = [
        (place, effect.name) for place, effect in enumerate(model.effects) for _ in effect.numbers()
    ]
    told: list[dict[str, str]] = [{} for _ in model.effects]
    unsure, left, rows = vague(covariance, items), CRITERIA.verdict.profile_evaluations, []
    # Numbers that no report states, such as coefficients of a field, are no quantities to pin down.
    stated = [
        item.name in effect.reported(model.setup)
        for effect in model.effects
        for item in effect.numbers()
    ]
    unsure = [index for index in unsure if stated[index]]
    for index, (place, item) in enumerate(zip((place for place, _ in names), items, strict=True)):
        if index not in unsure:
            told[place][item.name] = "interval"
    evidence = _evidence(evaluator, model, nuisances)
    for index in unsure:
        if left < 2:
            break
        place, effect = names[index]
        evaluator.report(f"how far {items[index].name} of {effect} may be off")
        found = profile(evidence, model.coordinates, covariance, index, items[index])
        left -= found.evaluations
        told[place][items[index].name] = found.told
        if found.told == "not identifiable":
            tied = combination(covariance, items, index)
            rows.append(
                {
                    "effect": effect,
                    "why": f"{items[index].name}: {tied or 'the data do not change with it'}",
                    "measure_instead": "one of the parameters that are tied to it"
                    if tied
                    else "it by other means",
                }
            )
    return told, rows
