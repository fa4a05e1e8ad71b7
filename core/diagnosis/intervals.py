"""How well each parameter of a named cause is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import t

from core.diagnosis.bench import Bench
from core.diagnosis.evidence import fit
from core.diagnosis.hypothesis import Model
from core.effects.sensor import CameraRegistration
from core.frames import FloatArray

__all__ = ["intervals", "stands"]

_NORMAL_95 = 1.96
_INTERVAL_STEPS = 400


def _spread(bench: Bench, model: Model) -> FloatArray:
    """Half widths of the 95 % intervals over 1.96, one for each search coordinate.

    The larger of two: Laplace's approximation, which trusts the noise model, and the robust spread of Liang and Zeger (1986): how
    far whole sequences pull in different directions, with as many degrees of freedom as there are sequences, less one.
    """
    blocks, columns, precision = bench.tempered(model), [*model.nuisance, *model.columns], bench.precision(model)
    own = slice(len(model.nuisance), None)
    solution = fit(blocks, columns, precision)
    laplace = np.sqrt(np.diag(solution.covariance)[own])
    replayed = np.array([item.accuracy for effect in model.effects for item in effect.numbers()])
    sequences = [block for block in blocks if block.name != "rest"]
    if len(sequences) < 2:
        return np.asarray(np.hypot(laplace, replayed))
    index = np.array(columns) + 1
    pulls = np.array([block.gram[index, 0] + block.gram[np.ix_(index, index)] @ solution.change for block in sequences])
    moved = (pulls @ solution.covariance)[:, own]
    deviation = np.sqrt((moved**2).sum(axis=0) * len(sequences) / (len(sequences) - 1))
    robust = deviation * t.ppf(0.975, len(sequences) - 1) / _NORMAL_95
    return np.asarray(np.hypot(np.maximum(laplace, robust), replayed))


def stands(bench: Bench, model: Model) -> bool:
    """Whether each cause has a strength whose interval leaves out none at all.

    Gains trust that sequences agree; a cause that fits one of them by chance is pulled elsewhere by the others, and its interval,
    which holds what they disagree about, tells.
    """
    spread, at = _spread(bench, model), 0
    for effect in model.effects:
        numbers = effect.numbers()
        own = zip(numbers, effect.coordinates, effect.neutral(bench.setup).coordinates, spread[at : at + len(numbers)], strict=True)
        if not any(abs(here - none) > _NORMAL_95 * sd for item, here, none, sd in own if not item.place):
            return False
        at += len(numbers)
    return True


def intervals(bench: Bench, model: Model) -> list[dict[str, dict[str, Any]]]:
    """For each effect: name to value, unit and 95 % interval (magnitudes by sampling)."""
    spread = _spread(bench, model)
    found, at = [], 0
    for effect in model.effects:
        number = len(effect.numbers())
        entry: dict[str, dict[str, Any]] = {}
        for item, value, sd in zip(effect.numbers(), effect.coordinates, spread[at : at + number], strict=True):
            low, high = item.value(value - _NORMAL_95 * sd), item.value(value + _NORMAL_95 * sd)
            entry[item.name] = {"value": item.value(value), "unit": item.unit, "low": low, "high": high}
        for name, (reported, unit) in effect.reported().items():
            entry.setdefault(name, {"value": reported, "unit": unit})
        if isinstance(effect, CameraRegistration):
            entry |= _magnitudes(effect, spread[at : at + number])
        found.append(entry)
        at += number
    return found


def _magnitudes(effect: CameraRegistration, spread: FloatArray) -> dict[str, dict[str, Any]]:
    drawn = np.array(effect.coordinates) + spread * np.random.default_rng(0).standard_normal((_INTERVAL_STEPS, 6))
    found = {}
    for name, part, unit in (("translation", slice(0, 3), "m"), ("rotation", slice(3, 6), "rad")):
        low, high = np.quantile(np.linalg.norm(drawn[:, part], axis=1), [0.025, 0.975])
        value = float(np.linalg.norm(np.array(effect.coordinates)[part]))
        # Noise only ever lengthens a short vector, so that the draws may all lie above its value.
        found[name] = {"value": value, "unit": unit, "low": min(float(low), value), "high": max(float(high), value)}
    return found
