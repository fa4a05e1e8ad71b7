from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from core.blind import Case, Result, all_cases, run_suite, scenario_of
from core.effects import DIAGNOSED, OUTSIDE
from core.errors import RunError
from core.synthetic import DISTURBANCES, HIDDEN, WEIGHED


def result(name: str, hidden: list[str], verdict: str, named: list[str]) -> Result:
    return Result(name, 0, [{"effect": one} for one in hidden], verdict, [{"effect": one} for one in named], 40.0, 20.0, 0.9, 1.0)


def test_suite_hides_every_effect_that_is_weighed_and_every_disturbance_once_and_nothing_ten_times() -> None:
    cases = all_cases(seed=3)
    assert [case.effect for case in cases if case.effect] == [*WEIGHED, *DISTURBANCES]
    assert sum(case.effect is None for case in cases) == 10
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == len(cases)


def test_other_effects_are_hidden_where_they_are_asked_for_and_leave_the_cases_of_the_rest_alone() -> None:
    everything = all_cases(seed=3, effects=list(HIDDEN))
    assert [case.effect for case in everything if case.effect] == list(HIDDEN)
    assert {case for case in all_cases(seed=3) if case.effect not in DISTURBANCES} <= set(everything)
    assert len({case.seed for case in everything}) == len(everything)
    with pytest.raises(RunError, match="cannot hide moon; it knows poisson_ratio"):
        all_cases(seed=3, effects=["moon"])


def test_bench_and_diagnosis_list_the_same_effects_as_weighed() -> None:
    assert tuple(effect.name for effect in DIAGNOSED if effect not in OUTSIDE) == WEIGHED


def test_cases_are_those_that_earlier_results_are_of() -> None:
    assert Case("camera_registration-7", 7009, "camera_registration") in all_cases(seed=7)
    drawn = {case.effect: dict(scenario_of(case).effects[0].parameters) for case in all_cases(7, 0, WEIGHED)}
    assert drawn["poisson_ratio"] == {"nu": 0.309}
    assert drawn["tool_offset"] == {"dx": 0.00133, "dy": -8e-05, "dz": 0.00111}
    assert drawn["camera_registration"] == {"translation": 0.0028, "rotation": 0.0285}


@pytest.mark.parametrize("effect", HIDDEN)
def test_case_hides_its_effect_and_the_same_one_each_time(effect: str) -> None:
    case = Case("case", 7, effect)
    scenario = scenario_of(case)
    assert [hidden.effect for hidden in scenario.effects] == [effect]
    assert scenario == scenario_of(case)
    assert scenario != scenario_of(Case("case", 8, effect))


def test_control_hides_nothing() -> None:
    assert scenario_of(Case("control", 1, None)).effects == ()


@pytest.mark.parametrize("name", DISTURBANCES)
def test_case_outside_the_catalogue_hides_no_effect(name: str) -> None:
    scenario = scenario_of(Case("case", 7, name))
    assert scenario.effects == () and [one.name for one in scenario.disturbances] == [name]


@pytest.mark.parametrize(("verdict", "right"), [("unexplained", True), ("ambiguous", True), ("found", False), ("none", False)])
def test_outside_the_catalogue_no_cause_alone_is_right(verdict: str, right: bool) -> None:
    assert replace(result("case", [], verdict, []), outside="camera_drift").right is right


@pytest.mark.parametrize(
    ("hidden", "verdict", "named", "right"),
    [
        (["gravity"], "found", ["gravity"], True),
        (["gravity"], "found", ["tool_offset"], False),
        (["gravity"], "none", [], False),
        (["gravity"], "ambiguous", ["gravity"], False),
        (["gravity"], "found", ["gravity", "tool_offset"], False),
        ([], "none", [], True),
        ([], "unexplained", [], False),
        ([], "found", ["gravity"], False),
    ],
)
def test_only_the_hidden_effect_alone_is_right(hidden: list[str], verdict: str, named: list[str], right: bool) -> None:
    assert result("case", hidden, verdict, named).right is right


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    cases = all_cases(seed=0, controls=1)
    done = [result(case.name, [], "none", []) for case in reversed(cases)]
    (tmp_path / "results.jsonl").write_text("".join(json.dumps(asdict(one)) + "\n" for one in done))
    told: list[Any] = []
    found = run_suite(tmp_path, cases, workers=2, report=lambda fraction, text: told.append((fraction, text)))
    assert [one.name for one in found] == [case.name for case in cases]
    assert told == [(1.0, f"{len(cases)} of {len(cases)} were there already")]


def test_torn_row_of_results_is_told_with_its_number(tmp_path: Path) -> None:
    whole = json.dumps(asdict(result("a", [], "none", [])))
    (tmp_path / "results.jsonl").write_text(f"{whole}\n{whole[:40]}\n")
    with pytest.raises(RunError, match="row 2 is not a result"):
        run_suite(tmp_path, [], workers=1)
