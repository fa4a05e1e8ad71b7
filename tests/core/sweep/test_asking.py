"""What may be asked of a sweep, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate.foundation.errors import EffectError, SetupError
from palpate.setup.setup import Box, Setup, Tool
from palpate.sweep import Axis, ParameterSpace, SweepSpec
from palpate.sweep.flat_directions import assess_direction
from palpate.sweep.result_rows import ResultRows
from palpate.sweep.samplers import point_batches

NU = Axis("poisson_ratio.nu", 0.3, 0.49)
SETUP = Setup(geometry=Box(size=(0.07, 0.04, 0.036)), tool=Tool(radius=5e-3))


@pytest.mark.parametrize(
    ("name", "low", "high", "said"),
    [
        ("poisson.nu", 0.3, 0.4, "no effect is called"),
        ("poisson_ratio.mu", 0.3, 0.4, "poisson_ratio.nu"),
        ("poisson_ratio.nu", 0.4, 0.3, "no range"),
        ("poisson_ratio.nu", 0.3, 0.6, "leaves 0 to 0.495"),
        ("poisson_ratio.nu", float("nan"), 0.4, "no range"),
        ("base_detachment.edge", 0.0, 1.0, "is a word"),
    ],
)
def test_an_axis_that_cannot_be_is_refused(name: str, low: float, high: float, said: str) -> None:
    with pytest.raises(EffectError, match=said):
        Axis(name, low, high)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"method": "best"}, "grid, random"),
        ({"steps": 1}, "2 to 1000"),
        ({"method": "cmaes"}, "two parameters"),
        ({"frames": 0}, "frames"),
    ],
)
def test_a_request_that_cannot_be_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(SetupError, match=said):
        SweepSpec(space=ParameterSpace((NU,)), **change)


def test_a_request_survives_json() -> None:
    asked = SweepSpec(
        space=ParameterSpace((NU,), {"gravity.specific_weight_over_stiffness": 1.0}),
        method="tpe",
        points=7,
        sequences=("a",),
        seed=3,
    )
    assert SweepSpec.from_json(asked.to_json()) == asked


def test_a_value_and_what_is_fixed_are_in_the_setup() -> None:
    setup = ParameterSpace((NU,), {"gravity.specific_weight_over_stiffness": 1.5}).setup(
        SETUP, {NU.name: 0.41}
    )
    assert (setup.material.poisson_ratio, setup.load.specific_weight_over_stiffness) == (0.41, 1.5)


def test_a_line_of_a_stiffness_is_even_in_its_logarithm() -> None:
    assert Axis("young_modulus.E", 1e3, 1e5).line(3) == pytest.approx([1e3, 1e4, 1e5])


def errors(points: list[dict[str, float]], best: float) -> list[float | None]:
    return [abs(point[NU.name] - best) for point in points]


def test_each_level_of_a_grid_spans_a_step_to_both_sides_of_the_best() -> None:
    asked = point_batches(SweepSpec(space=ParameterSpace((NU,)), steps=5, levels=2))
    first = next(asked)
    second = asked.send(errors(first, 0.4))
    step = (0.49 - 0.3) / 4
    assert [point[NU.name] for point in second] == pytest.approx(
        np.linspace(0.395 - step, 0.395 + step, 5).tolist()
    )
    with pytest.raises(StopIteration):
        asked.send(errors(second, 0.4))


@pytest.mark.parametrize("method", ["tpe", "cmaes"])
def test_optuna_walks_the_same_way_twice_and_nears_the_optimum(method: Any) -> None:
    space = ParameterSpace((NU, Axis("young_modulus.E", 1e3, 1e5)))
    walks = []
    for _ in range(2):
        asked = point_batches(SweepSpec(space=space, method=method, points=48, seed=4))
        walked, points = [], next(asked)
        while True:
            walked += points
            try:
                points = asked.send(
                    [
                        (p[NU.name] - 0.42) ** 2 + (np.log10(p["young_modulus.E"]) - 4) ** 2 / 100
                        for p in points
                    ]
                )
            except StopIteration:
                break
        walks.append(walked)
    assert walks[0] == walks[1] and len(walks[0]) == 48
    best = min(
        walks[0],
        key=lambda p: (p[NU.name] - 0.42) ** 2 + (np.log10(p["young_modulus.E"]) - 4) ** 2 / 100,
    )
    assert best[NU.name] == pytest.approx(0.42, abs=0.03)


def sums(squares: np.ndarray) -> np.ndarray:
    """Of one point of weight one in each probe, with these squared errors (k, probes)."""
    ones = np.ones_like(squares)
    return np.stack([squares, ones, squares, ones], axis=-1)


def test_noise_between_probes_is_flat_and_a_change_in_all_of_them_is_not() -> None:
    rng = np.random.default_rng(0)
    base = 1e-7 * (1 + 0.5 * rng.random(12))
    noisy = np.stack([base * (1 + 0.2 * rng.standard_normal(12)) for _ in range(5)])
    assert assess_direction("a", range(5), sums(noisy), "distance", 0).flat
    assert (
        assess_direction(
            "a", range(5), sums(noisy * np.array([1, 1.2, 1.5, 2, 3])[:, None]), "distance", 0
        ).flat
        is False
    )
    assert (
        assess_direction("a", range(2), sums(np.array([[1e-7], [2e-7]])), "distance", 0).flat
        is None
    )


def test_rows_outlive_a_torn_end(tmp_path: Path) -> None:
    kept = ResultRows(tmp_path / "rows")
    kept.start([])
    kept.add({"number": 0})
    with (tmp_path / "rows").open("a") as stream:
        stream.write('{"num')
    assert kept.read() == [{"number": 0}]
