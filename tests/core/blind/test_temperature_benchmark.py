"""The benchmark that chooses the temperature of probabilities, on rows with a known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from blind_results import result

from benchmarks.temperature_choice import best_temperature, loss, top_effect
from palpate.blind.case_results import CaseResult
from palpate.diagnosis.report.model_probabilities import probabilities

NAMES = ("tool_radius", "gravity", "poisson_ratio", "stiff_inclusion")
TRUE = 6.0


def _model(gain: float, *names: str) -> dict[str, object]:
    return {
        "effects": [{"effect": name} for name in names],
        "gain_nats": gain,
        "asked_nats": 25.0 * len(names),
    }


def _drawn(seed: int) -> CaseResult:
    """Result with gains that are overconfident by a factor of six: the truth is drawn from their
    softmax at that temperature.
    """
    random = np.random.default_rng(seed)
    surplus: dict[tuple[str, ...], float] = {
        (name,): 20.0 * random.standard_normal() for name in NAMES
    }
    chances = probabilities(surplus, TRUE)
    names = list(chances)
    hidden = names[int(random.choice(len(names), p=list(chances.values())))]
    found = result("clear" if hidden else "control", " ".join(hidden))
    return replace(
        found,
        report={
            **found.report,
            "models": [_model(gain + 25.0, *key) for key, gain in surplus.items()],
        },
    )


def test_temperature_is_found_again() -> None:
    rows = [_drawn(seed) for seed in range(400)]
    assert best_temperature(rows) == pytest.approx(TRUE, rel=0.25)
    assert loss(rows, TRUE) < min(loss(rows, 1.0), loss(rows, 40.0))
    (stated, true), (bold, same) = top_effect(rows, TRUE), top_effect(rows, 1.0)
    assert abs(stated.mean() - true.mean()) < 0.04 < abs(bold.mean() - same.mean())


def test_of_equal_temperatures_the_highest_is_chosen() -> None:
    sure = result("clear", "gravity")
    rows = [replace(sure, report={**sure.report, "models": [_model(25.0 + 500.0, "gravity")]})]
    assert 10.0 < best_temperature(rows) and loss(rows, best_temperature(rows)) < 1e-6


def test_modulus_alone_is_nothing_hidden() -> None:
    alone = result("modulus", "young_modulus")
    assert (
        loss([replace(alone, report={**alone.report, "models": [_model(-5.0, "gravity")]})], 1.0)
        < 1e-6
    )
