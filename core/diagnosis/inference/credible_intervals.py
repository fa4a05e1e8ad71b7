"""Credible intervals of the parameters of named causes, and of the modulus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import t

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.posterior import Posterior
from palpate.effects import Effect, NuisanceBlock
from palpate.effects.elastic_material import MODULUS_ACCURACY
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Setup

__all__ = [
    "as_stated",
    "intervals",
    "is_supported_by_all_sequences",
    "modulus_interval",
    "spread_of",
]


def _robust(
    blocks: Sequence[Block], columns: Sequence[int], precision: FloatArray, own: slice
) -> tuple[FloatArray, FloatArray]:
    """Return the most probable change of the columns in `own` (n,), and its deviations (n,).

    The deviations are half widths of 95 % intervals over 1.96: the larger of Laplace's
    approximation, which trusts the noise model, and the robust spread of Liang and Zeger (1986)
    from the pulls of whole sequences, with one degree of freedom less than there are sequences.
    """
    solution = fit(blocks, columns, precision)
    change, laplace = solution.change[own], np.sqrt(np.diag(solution.covariance)[own])
    sequences = [block for block in blocks if block.name != "rest"]
    if len(sequences) < 2:
        return change, laplace
    index = np.array(columns) + 1
    pulls = np.array(
        [
            block.gram[index, 0] + block.gram[np.ix_(index, index)] @ solution.change
            for block in sequences
        ]
    )
    moved = (pulls @ solution.covariance)[:, own]
    deviation = np.sqrt((moved**2).sum(axis=0) * len(sequences) / (len(sequences) - 1))
    return change, np.maximum(
        laplace, deviation * t.ppf(0.975, len(sequences) - 1) / CRITERIA.intervals.normal_quantile
    )


def spread_of(posterior: Posterior, model: Model) -> FloatArray:
    """Return the deviation of each search coordinate, the replay's own error included.

    It is the half width of the 95 % interval over 1.96.
    """
    own = slice(len(model.nuisance), None)
    robust = _robust(
        posterior.tempered(model),
        [*model.nuisance, *model.columns],
        posterior.precision(model),
        own,
    )[1]
    replayed = np.array([item.accuracy for item in model.parameters])
    return np.asarray(np.hypot(robust, replayed))


def is_supported_by_all_sequences(evaluator: Evaluator, model: Model, without: Model) -> bool:
    """Return whether sequences agree on the model's last cause: its share is surely above zero.

    The change of the cause against the model `without` it is one pattern. Its share in the data is
    one where the cause is right; sequences that show nothing of it pull the share elsewhere. The
    cause's own numbers could not decide: an inclusion of 50 times the stiffness is like one of 10,
    and its place means nothing where it is as stiff as the rest.
    """
    signature = [(model.effects[-1], model.predictions)]
    extended = evaluator.with_signatures(without, signature, without)
    columns = [*extended.nuisance, *extended.columns, *extended.layout.signatures]
    precision = np.zeros((len(columns), len(columns)))
    precision[:-1, :-1], precision[-1, -1] = (
        evaluator.precision(extended),
        CRITERIA.intervals.pattern_share**-2,
    )
    share, spread = _robust(evaluator.tempered(extended), columns, precision, slice(-1, None))
    return bool(share[0] > CRITERIA.intervals.normal_quantile * spread[0])


def as_stated(posterior: Posterior, model: Model) -> tuple[str, ...]:
    """Return the names of the effects of which every number may be as stated.

    The intervals include the replay's own error. An effect that is absent at one value of a single
    number, like an inclusion as stiff as the rest, is not among them while others of its numbers,
    like its place, differ from those of the neutral effect.
    """
    found, setup = [], posterior.problem.setup
    for effect, spread in model.split(spread_of(posterior, model)):
        away = np.abs(np.subtract(effect.coordinates, effect.neutral(setup).coordinates))
        if np.all(away <= CRITERIA.intervals.normal_quantile * spread):
            found.append(effect.name)
    return tuple(found)


def intervals(posterior: Posterior, model: Model) -> list[dict[str, dict[str, Any]]]:
    """Return for each effect a mapping from name to value, unit and 95 % interval.

    Intervals of reported numbers that follow from the parameters, such as magnitudes, are sampled.
    """
    spread, setup, found = spread_of(posterior, model), posterior.problem.setup, []
    for effect, own in model.split(spread):
        entry: dict[str, dict[str, Any]] = {}
        told = effect.reported(setup)
        for item, value, deviation in zip(effect.numbers(), effect.coordinates, own, strict=True):
            if item.name not in told:
                continue
            low, high = item.interval(value, CRITERIA.intervals.normal_quantile * deviation)
            entry[item.name] = {
                "value": item.value(value),
                "unit": item.unit,
                "low": low,
                "high": high,
            }
        for name, (reported, unit) in told.items():
            entry.setdefault(name, {"value": reported, "unit": unit})
        found.append(entry | _derived_intervals(effect, own, setup))
    return found


def modulus_interval(posterior: Posterior, model: Model) -> tuple[float, float, float] | None:
    """Return Young's modulus and its 95 % interval [Pa] by the forces alone; None without forces.

    The stated modulus has no weight. The model must not have the modulus among its causes.
    """
    problem = posterior.problem
    if not problem.forces:
        return None
    (own,) = problem.blocks.places(NuisanceBlock.YOUNG_MODULUS)
    nuisances = problem.nuisances.precision.copy()
    nuisances[own, own] *= CRITERIA.priors.flat_factor
    columns, precision = [*model.nuisance, *model.columns], posterior.precision(model, nuisances)
    change, deviation = _robust(posterior.tempered(model), columns, precision, slice(own, own + 1))
    # A force is linear in the modulus, so that the fit is exact in it and not in its logarithm.
    factor = max(1.0 + float(change[0]), CRITERIA.intervals.least_modulus_factor)
    spread = float(np.hypot(deviation[0] / factor, MODULUS_ACCURACY))
    low, value, high = (
        model.setup.material.young_modulus
        * factor
        * np.exp(CRITERIA.intervals.normal_quantile * spread * np.array([-1.0, 0.0, 1.0]))
    )
    return float(value), float(low), float(high)


def _derived_intervals(
    effect: Effect, deviations: FloatArray, setup: Setup
) -> dict[str, dict[str, Any]]:
    """Return value, unit and sampled 95 % interval of reported numbers that are no parameters."""
    reported = effect.reported(setup)
    names = [name for name in reported if name not in effect.values()]
    if not names:
        return {}
    noise = np.random.default_rng(0).standard_normal((CRITERIA.intervals.draws, len(deviations)))
    drawn = np.array(effect.coordinates) + deviations * noise
    sampled, found = [effect.moved(one.tolist()).reported(setup) for one in drawn], {}
    for name in names:
        value, unit = reported[name]
        low, high = np.quantile([float(one[name][0]) for one in sampled], [0.025, 0.975])
        # Noise only lengthens a short vector, so that all draws may lie above its value.
        found[name] = {
            "value": value,
            "unit": unit,
            "low": min(float(low), float(value)),
            "high": max(float(high), float(value)),
        }
    return found
