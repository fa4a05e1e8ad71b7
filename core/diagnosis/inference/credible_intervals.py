"""How well each parameter of a named cause is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import t

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block, fit
from palpate.diagnosis.inference.hypothesis import TWINS, Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.effects.elastic_material import YoungModulus
from palpate.effects.sensor import CameraRegistration
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Setup

__all__ = ["intervals", "modulus_interval", "spread_of", "stands"]


def _robust(
    blocks: Sequence[Block], columns: Sequence[int], precision: FloatArray, own: slice
) -> tuple[FloatArray, FloatArray]:
    """Most probable change of the columns in `own` (n,), and the half widths (n,) of its 95 %
    intervals over 1.96.

    The larger of two: Laplace's approximation, which trusts the noise model, and the robust spread
    of Liang and Zeger (1986): how far whole sequences pull in different directions, with as many
    degrees of freedom as there are sequences, less one.
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


def spread_of(bench: Bench, model: Model) -> FloatArray:
    """Half widths of the 95 % intervals over 1.96, one for each search coordinate, with what the
    replay's own error leaves.
    """
    own = slice(len(model.nuisance), None)
    robust = _robust(
        bench.tempered(model), [*model.nuisance, *model.columns], bench.precision(model), own
    )[1]
    replayed = np.array([item.accuracy for effect in model.effects for item in effect.numbers()])
    return np.asarray(np.hypot(robust, replayed))


def stands(bench: Bench, model: Model, without: Model) -> bool:
    """Whether sequences agree that the model's last cause is there: the interval of how much of it
    they see leaves out none.

    What the cause changes against the model `without` it is one pattern; its share in the data is
    one where it is right, and is pulled elsewhere by sequences that know nothing of it. The cause's
    own numbers could not tell: a lump of 50 times the stiffness is like one of 10, and its place
    means nothing where it is as stiff as the rest.
    """
    extended = bench.block_with(without, [(model.effects[-1], model.predictions)], without)
    columns = [*extended.nuisance, *extended.columns, *extended.extra["signatures"]]
    precision = np.zeros((len(columns), len(columns)))
    precision[:-1, :-1], precision[-1, -1] = (
        bench.precision(extended),
        CRITERIA.intervals.pattern_share**-2,
    )
    share, spread = _robust(bench.tempered(extended), columns, precision, slice(-1, None))
    return bool(share[0] > CRITERIA.intervals.normal_quantile * spread[0])


def intervals(bench: Bench, model: Model) -> list[dict[str, dict[str, Any]]]:
    """For each effect: name to value, unit and 95 % interval (magnitudes by sampling)."""
    spread = spread_of(bench, model)
    found, at = [], 0
    for effect in model.effects:
        number = len(effect.numbers())
        entry: dict[str, dict[str, Any]] = {}
        for item, value, sd in zip(
            effect.numbers(), effect.coordinates, spread[at : at + number], strict=True
        ):
            low, high = item.interval(value, CRITERIA.intervals.normal_quantile * sd)
            entry[item.name] = {
                "value": item.value(value),
                "unit": item.unit,
                "low": low,
                "high": high,
            }
        for name, (reported, unit) in effect.reported(bench.setup).items():
            entry.setdefault(name, {"value": reported, "unit": unit})
        if isinstance(effect, CameraRegistration):
            entry |= _magnitudes(effect, spread[at : at + number], bench.setup)
        found.append(entry)
        at += number
    return found


def modulus_interval(bench: Bench, model: Model) -> tuple[float, float, float] | None:
    """Young's modulus and its 95 % interval [Pa] by the forces alone, whatever was stated of it;
    None without forces.

    For a model that does not have the modulus among its causes.
    """
    if not bench.nuisances.forces:
        return None
    (own,) = TWINS[YoungModulus]
    nuisances = bench.nuisances.precision.copy()
    nuisances[own, own] *= CRITERIA.priors.flat_factor
    columns, precision = [*model.nuisance, *model.columns], bench.precision(model, nuisances)
    change, deviation = _robust(bench.tempered(model), columns, precision, slice(own, own + 1))
    # A force is linear in the modulus, so that the fit is exact in it and not in its logarithm.
    factor = max(1.0 + float(change[0]), CRITERIA.intervals.least_modulus_factor)
    spread = float(np.hypot(deviation[0] / factor, YoungModulus.numbers()[0].accuracy))
    low, value, high = (
        model.setup.material.young_modulus
        * factor
        * np.exp(CRITERIA.intervals.normal_quantile * spread * np.array([-1.0, 0.0, 1.0]))
    )
    return float(value), float(low), float(high)


def _magnitudes(
    effect: CameraRegistration, spread: FloatArray, setup: Setup
) -> dict[str, dict[str, Any]]:
    drawn = np.array(effect.coordinates) + spread * np.random.default_rng(0).standard_normal(
        (CRITERIA.intervals.draws, 6)
    )
    magnitudes, found = [effect.moved(one.tolist()).reported(setup) for one in drawn], {}
    for name in ("translation", "rotation"):
        value, unit = effect.reported(setup)[name]
        low, high = np.quantile([float(one[name][0]) for one in magnitudes], [0.025, 0.975])
        # Noise only ever lengthens a short vector, so that the draws may all lie above its value.
        found[name] = {
            "value": value,
            "unit": unit,
            "low": min(float(low), float(value)),
            "high": max(float(high), float(value)),
        }
    return found
