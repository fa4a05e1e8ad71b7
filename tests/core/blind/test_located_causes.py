"""Places and lines made by hand, whose distances are known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from blind_results import cause, result

from palpate.blind import CaseResult, draw_cases, drawn_of
from palpate.blind.located_causes import centre_error, line_share, same_way, true_line
from palpate.blind.parameter_errors import reported_parameters
from palpate.blind.targets import judge_targets
from palpate.effects import effect_named
from palpate.setup.setup import Box, Setup, Tool
from palpate.synthetic import HiddenEffect, ShapeScenario

TUBE = {
    "aside": 4e-3,
    "z": 0.02,
    "heading": 0.4,
    "inclination": 0.05,
    "bend": 5.0,
    "sag": -3.0,
    "radius": 3e-3,
    "stiffness_ratio": 10.0,
}
BOX = Box(size=(0.07, 0.04, 0.036))


def on_shape(one: CaseResult, name: str = "case") -> CaseResult:
    return replace(one, case=replace(one.case, name=name, shape="dome"))


def lump(found: tuple[float, float, float] | None, name: str) -> CaseResult:
    """An inclusion at (0, 0, 20 mm) that was found there, or not at all."""
    causes = [
        cause(
            "stiff_inclusion",
            0.99,
            **{axis: (at, at, at) for axis, at in zip("xyz", where, strict=True)},
        )
        for where in ([found] if found else [])
    ]
    truth = {"x": 0.0, "y": 0.0, "z": 0.02}
    verdict = "found" if found else "none"
    return on_shape(result("clear", "stiff_inclusion", verdict, causes, truth=truth), name)


def tube(found: list[list[float]] | None, true: list[list[float]]) -> CaseResult:
    """A tube along `true` of which `found` was reported; None where it was not named."""
    causes = [{**cause("stiff_tube"), "polyline": found}] if found is not None else []
    made = result("clear", "stiff_tube", "found" if causes else "none", causes)
    return on_shape(replace(made, hidden=[{**made.hidden[0], "polyline": true}]))


def target(key: str, results: list[CaseResult]) -> dict[str, Any]:
    return next(row for row in judge_targets(results) if row["key"] == key)


def test_error_of_a_centre_is_its_distance_in_space() -> None:
    found = lump((1e-3, 2e-3, 0.022), "a")
    assert centre_error(found) == pytest.approx(3e-3)
    assert centre_error(lump(None, "b")) is None
    assert centre_error(tube(None, [[0, 0, 0], [1, 0, 0]])) is None


def test_centres_are_judged_by_their_median_and_one_by_one() -> None:
    rows = [lump((1e-3, 0, 0.02), "a"), lump((2.9e-3, 0, 0.02), "b"), lump((9e-3, 0, 0.02), "c")]
    middle = target("shapes.inclusion.centre", rows)
    assert middle["reached"]["value"] == pytest.approx(2.9e-3) and middle["met"] is True
    near = target("shapes.inclusion.near", [*rows, lump(None, "d")])
    assert (near["reached"]["hits"], near["reached"]["n"], near["met"]) == (2, 4, False)
    on_blocks = [replace(one, case=replace(one.case, shape=None)) for one in rows]
    assert target("shapes.inclusion.near", on_blocks)["met"] is None


STRAIGHT = [[-0.03, 0.0, 0.02], [0.03, 0.0, 0.02]]


@pytest.mark.parametrize(
    ("found", "share"),
    [
        (STRAIGHT, 1.0),
        (STRAIGHT[::-1], 1.0),
        ([[-0.03, 0.0, 0.0229], [0.03, 0.0, 0.0229]], 1.0),
        ([[-0.03, 0.0, 0.0231], [0.03, 0.0, 0.0231]], 0.0),
        # The half that is found reaches 3 mm beyond its end: 33 of 60 mm.
        ([[-0.03, 0.0, 0.02], [0.0, 0.0, 0.02]], 33 / 60),
        # The whole tube is found, and as much again where there is none.
        ([[-0.03, 0.0, 0.02], [0.09, 0.0, 0.02]], 63 / 120),
        ([], 0.0),
    ],
)
def test_share_of_a_line_is_of_both_lines(found: list[list[float]], share: float) -> None:
    assert line_share(tube(found, STRAIGHT)) == pytest.approx(share, abs=0.012)


def test_tubes_are_judged_by_their_lines() -> None:
    rows = [tube(STRAIGHT, STRAIGHT), tube(STRAIGHT[:1], STRAIGHT), tube(None, STRAIGHT)]
    assert target("shapes.tube.line", rows)["reached"]["n"] == 2
    near = target("shapes.tube.near", rows)
    assert (near["reached"]["hits"], near["reached"]["n"]) == (1, 3)
    assert target("shapes.tube.near", rows[:1])["met"] is True


def test_true_line_runs_from_surface_to_surface_where_the_effect_has_its_own() -> None:
    line = np.array(true_line(HiddenEffect("stiff_tube", TUBE), BOX))
    own = effect_named("stiff_tube")(**TUBE)  # type: ignore[arg-type]
    stated = own.located(Setup(geometry=BOX, tool=Tool(radius=5e-3)))["polyline"]
    assert (BOX.outside(line) < 0).all() and -1.2e-3 < BOX.outside(line[[0, -1]]).min() < 0
    assert line_share(tube(stated, line.tolist())) == 1.0
    assert np.linalg.norm(line[0] - stated[0]) < 1e-3


def test_tube_is_the_same_one_from_either_end() -> None:
    turned = {
        **TUBE,
        "heading": TUBE["heading"] + math.pi,
        **{name: -TUBE[name] for name in ("aside", "inclination", "bend")},
    }
    lines = [true_line(HiddenEffect("stiff_tube", values), BOX) for values in (TUBE, turned)]
    assert line_share(tube(lines[1], lines[0])) == pytest.approx(1.0)
    true, found = (
        {name: {"value": value, "unit": ""} for name, value in values.items()}
        for values in (TUBE, turned)
    )
    assert {name: one["value"] for name, one in same_way(true, found).items()} == turned
    assert same_way(true, true) == true
    named = [{"effect": "stiff_tube", "probability": 0.99, "parameters": found}]
    made = result("clear", "stiff_tube", "found", named, truth=TUBE)
    assert max(abs(one.error) for one in reported_parameters([made])) < 1e-9


def test_hidden_tube_of_a_drawn_case_lies_in_its_body() -> None:
    case = next(case for case in draw_cases(3, 60, shapes=True) if case.hidden == ("stiff_tube",))
    drawn = drawn_of(case)
    assert isinstance(drawn, ShapeScenario)
    line = np.array(true_line(drawn.scenario.effects[0], drawn.true))
    assert len(line) > 20 and (drawn.true.outside(line) < 0).all()
