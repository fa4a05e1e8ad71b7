"""Choice of the temperature of a diagnosis' probabilities by cross-validation on a blind suite.

    python -m benchmarks.temperature_choice results.jsonl

Cases go to two halves in turn. On each half the temperature is chosen under which the hidden sets
of causes are most probable. Calibration error and Brier score with it, and with the temperature in
use, are measured on the other half. Cases outside the catalogue have no right set and are left out.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from palpate.blind.calibration import brier, calibration_error
from palpate.blind.case_results import CaseResult, read_results
from palpate.blind.proportions import IntervalEstimate
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.report.model_probabilities import probabilities
from palpate.effects.elastic_material import YoungModulus
from palpate.foundation.arrays import FloatArray

__all__ = ["best_temperature", "loss", "run", "top_effect"]

TEMPERATURES = tuple(float(one) for one in np.geomspace(0.25, 64.0, 33))
MODULUS = YoungModulus.name
"""Without forces the right set is empty where only the modulus is hidden."""
LEAST_PROBABILITY = 1e-12
"""Probability of a set that was not tried or was rejected [1]."""


def _probabilities(result: CaseResult, temperature: float) -> dict[frozenset[str], float]:
    """Return the probability of each set of causes, in whatever order they were found."""
    surplus: dict[tuple[str, ...], float] = {}
    for model in result.report["models"]:
        names = tuple(effect["effect"] for effect in model["effects"])
        rejected = model["asked_nats"] is None
        surplus[names] = max(
            -np.inf if rejected else model["gain_nats"] - model["asked_nats"],
            surplus.get(names, -np.inf),
        )
    merged: dict[frozenset[str], float] = {}
    for names, chance in probabilities(surplus, temperature).items():
        merged[frozenset(names)] = merged.get(frozenset(names), 0.0) + chance
    return merged


def loss(results: Sequence[CaseResult], temperature: float) -> float:
    """Return the mean negative log probability of the hidden set [nats]."""
    chances = [_probabilities(one, temperature).get(one.truth - {MODULUS}, 0.0) for one in results]
    return float(-np.log(np.maximum(chances, LEAST_PROBABILITY)).mean())


def best_temperature(results: Sequence[CaseResult]) -> float:
    """Return the temperature of least loss; of several the highest, which is the most cautious."""
    losses = np.array([loss(results, one) for one in TEMPERATURES])
    return TEMPERATURES[int(np.flatnonzero(losses <= losses.min() + 1e-6)[-1])]


def top_effect(results: Sequence[CaseResult], temperature: float) -> tuple[FloatArray, FloatArray]:
    """Return the probability (n,) of the most probable effect, and whether it is hidden (n,)."""
    stated, true = [], []
    for one in results:
        of_effect: dict[str, float] = {}
        for names, chance in _probabilities(one, temperature).items():
            for name in names:
                of_effect[name] = of_effect.get(name, 0.0) + chance
        if of_effect:
            best = max(of_effect, key=lambda name: of_effect[name])
            stated.append(of_effect[best])
            true.append(float(best in one.truth))
    return np.array(stated), np.array(true)


def _text(measured: IntervalEstimate) -> str:
    ends = (measured.value, measured.low, measured.high)
    return (
        "–"
        if None in ends
        else "{:.3f} ({:.3f} to {:.3f})".format(*(float(one or 0.0) for one in ends))
    )


def _has_required_gains(result: CaseResult) -> bool:
    """Return whether the report has the required gain of each set; early reports do not."""
    return all("asked_nats" in model for model in result.report["models"])


def run(console: Console, file: Path) -> bool:
    """Print the table; return whether both halves have a case."""
    results = [
        one
        for one in read_results(file)
        if one.report and not one.outside and _has_required_gains(one)
    ]
    halves = (results[::2], results[1::2])
    table = Table(title=f"{file.name}: temperature chosen on one half, judged on the other")
    for name in (
        "chosen on",
        "temperature",
        "judged on",
        "loss [nats]",
        "calibration error",
        "Brier score",
    ):
        table.add_column(name)
    for number, judged in enumerate(halves):
        chosen = halves[1 - number]
        if not chosen or not judged:
            console.print(f"{file}: {len(results)} cases with a report are too few for two halves")
            return False
        for source, temperature in (
            ("in use", CRITERIA.naming.probability_temperature),
            (f"{len(chosen)} cases", best_temperature(chosen)),
        ):
            pairs = top_effect(judged, temperature)
            table.add_row(
                source,
                f"{temperature:.2f}",
                f"{len(judged)} cases",
                f"{loss(judged, temperature):.4f}",
                _text(calibration_error(*pairs)),
                _text(brier(*pairs)),
            )
    console.print(table)
    return True


if __name__ == "__main__":
    sys.exit(0 if run(Console(width=140), Path(sys.argv[1])) else 1)
