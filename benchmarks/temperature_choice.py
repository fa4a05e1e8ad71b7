"""The temperature of a diagnosis' probabilities, chosen on one half of a blind suite and judged on
the other.

`python -m benchmarks.temperature_choice results.jsonl`: cases by turns into either half; on each half the
temperature under which the sets of causes that were hidden are most probable, and on the other half
the calibration error and the Brier score with it, beside those with the temperature that is in use.
Cases outside the catalogue have no set that is right, and are left out.
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
from palpate.diagnosis.search.model_probabilities import probabilities
from palpate.effects.elastic_material import YoungModulus
from palpate.foundation.arrays import FloatArray

__all__ = ["first_at", "loss", "run", "warmest"]

TEMPERATURES = tuple(float(one) for one in np.geomspace(0.25, 64.0, 33))
MODULUS = YoungModulus.name
"""Without forces nothing is what is right where it alone is hidden."""
LEAST = 1e-12
"""Probability of a set that was not tried, or was refused."""


def _chances(result: CaseResult, temperature: float) -> dict[frozenset[str], float]:
    """Of each set of causes, whatever the order they were found in."""
    surplus: dict[tuple[str, ...], float] = {}
    for model in result.report["models"]:
        names = tuple(effect["effect"] for effect in model["effects"])
        refused = model["asked_nats"] is None
        surplus[names] = max(
            -np.inf if refused else model["gain_nats"] - model["asked_nats"],
            surplus.get(names, -np.inf),
        )
    found: dict[frozenset[str], float] = {}
    for names, chance in probabilities(surplus, temperature).items():
        found[frozenset(names)] = found.get(frozenset(names), 0.0) + chance
    return found


def loss(results: Sequence[CaseResult], temperature: float) -> float:
    """Mean of minus the logarithm of the probability that the hidden set has [nats]."""
    chances = [_chances(one, temperature).get(one.truth - {MODULUS}, 0.0) for one in results]
    return float(-np.log(np.maximum(chances, LEAST)).mean())


def warmest(results: Sequence[CaseResult]) -> float:
    """The temperature of least loss; of several the highest, which claims least."""
    losses = np.array([loss(results, one) for one in TEMPERATURES])
    return TEMPERATURES[int(np.flatnonzero(losses <= losses.min() + 1e-6)[-1])]


def first_at(results: Sequence[CaseResult], temperature: float) -> tuple[FloatArray, FloatArray]:
    """Probability (n,) of the most probable effect at this temperature, and whether it is hidden
    (n,).
    """
    stated, true = [], []
    for one in results:
        of_effect: dict[str, float] = {}
        for names, chance in _chances(one, temperature).items():
            for name in names:
                of_effect[name] = of_effect.get(name, 0.0) + chance
        if of_effect:
            best = max(of_effect, key=lambda name: of_effect[name])
            stated.append(of_effect[best])
            true.append(float(best in one.truth))
    return np.array(stated), np.array(true)


def _in_words(measured: IntervalEstimate) -> str:
    ends = (measured.value, measured.low, measured.high)
    return (
        "–"
        if None in ends
        else "{:.3f} ({:.3f} to {:.3f})".format(*(float(one or 0.0) for one in ends))
    )


def _weighed(result: CaseResult) -> bool:
    """Whether its report says what was asked of each set; before November 2026 none did."""
    return all("asked_nats" in model for model in result.report["models"])


def run(console: Console, file: Path) -> bool:
    """Print the table; whether there is a case in each half."""
    results = [
        one for one in read_results(file) if one.report and not one.outside and _weighed(one)
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
            (f"{len(chosen)} cases", warmest(chosen)),
        ):
            pairs = first_at(judged, temperature)
            table.add_row(
                source,
                f"{temperature:.2f}",
                f"{len(judged)} cases",
                f"{loss(judged, temperature):.4f}",
                _in_words(calibration_error(*pairs)),
                _in_words(brier(*pairs)),
            )
    console.print(table)
    return True


if __name__ == "__main__":
    sys.exit(0 if run(Console(width=140), Path(sys.argv[1])) else 1)
