"""Sampling methods of a sweep on functions of known minimum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from palpate.sweep import Axis, ParameterSpace, SweepSpec
from palpate.sweep.samplers import point_batches

NU = Axis("poisson_ratio.nu", 0.3, 0.49)


def errors(points: list[dict[str, float]], best: float) -> list[float | None]:
    return [abs(point[NU.name] - best) for point in points]


def test_each_grid_level_spans_one_step_to_both_sides_of_the_best_point() -> None:
    sampler = point_batches(SweepSpec(space=ParameterSpace((NU,)), steps=5, levels=2))
    first = next(sampler)
    second = sampler.send(errors(first, 0.4))
    step = (0.49 - 0.3) / 4
    assert [point[NU.name] for point in second] == pytest.approx(
        np.linspace(0.395 - step, 0.395 + step, 5).tolist()
    )
    with pytest.raises(StopIteration):
        sampler.send(errors(second, 0.4))


@pytest.mark.parametrize("method", ["tpe", "cmaes"])
def test_optuna_visits_the_same_points_twice_and_approaches_the_optimum(method: Any) -> None:
    space = ParameterSpace((NU, Axis("young_modulus.E", 1e3, 1e5)))
    runs = []
    for _ in range(2):
        sampler = point_batches(SweepSpec(space=space, method=method, points=48, seed=4))
        visited, points = [], next(sampler)
        while True:
            visited += points
            try:
                points = sampler.send(
                    [
                        (p[NU.name] - 0.42) ** 2 + (np.log10(p["young_modulus.E"]) - 4) ** 2 / 100
                        for p in points
                    ]
                )
            except StopIteration:
                break
        runs.append(visited)
    assert runs[0] == runs[1] and len(runs[0]) == 48
    best = min(
        runs[0],
        key=lambda p: (p[NU.name] - 0.42) ** 2 + (np.log10(p["young_modulus.E"]) - 4) ** 2 / 100,
    )
    assert best[NU.name] == pytest.approx(0.42, abs=0.03)
