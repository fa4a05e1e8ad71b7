"""Scores of single results, and the file of results."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from blind_results import cause, result

from palpate.blind import CaseResult, read_results
from palpate.blind.case_results import add_result
from palpate.foundation.errors import RunError


def scored(
    kind: str, hidden: str, verdict: str, named: str, not_identifiable: bool = True
) -> CaseResult:
    return result(
        kind,
        hidden,
        verdict,
        [cause(one) for one in named.split()],
        not_identifiable=not_identifiable,
    )


@pytest.mark.parametrize(
    ("kind", "hidden", "verdict", "named", "right"),
    [
        ("clear", "gravity", "found", "gravity", True),
        ("clear", "gravity", "found", "tool_offset", False),
        ("clear", "gravity", "none", "", False),
        ("clear", "gravity", "ambiguous", "gravity", False),
        ("clear", "gravity", "found", "gravity tool_offset", False),
        ("pair", "gravity tool_offset", "found", "tool_offset gravity", True),
        ("pair", "gravity tool_offset", "found", "gravity", False),
        ("control", "", "none", "", True),
        ("control", "", "unexplained", "", False),
        ("control", "", "found", "gravity", False),
        ("outside", "camera_drift", "unexplained", "", True),
        ("outside", "camera_drift", "ambiguous", "gravity tool_offset", True),
        ("outside", "camera_drift", "found", "gravity", False),
        ("outside", "camera_drift", "none", "", False),
        ("twins", "tool_radius", "found", "tool_radius", True),
        ("twins", "tool_radius", "ambiguous", "tool_offset tool_radius", True),
        ("twins", "tool_radius", "ambiguous", "tool_offset gravity", False),
        ("twins", "tool_radius", "found", "tool_offset tool_radius", False),
    ],
)
def test_correct_verdict_depends_on_the_kind_of_case(
    kind: str, hidden: str, verdict: str, named: str, right: bool
) -> None:
    assert scored(kind, hidden, verdict, named).right is right


@pytest.mark.parametrize(
    ("verdict", "named", "not_identifiable", "right"),
    [
        ("none", "", True, True),
        ("none", "", False, False),
        ("unexplained", "", True, False),
        ("found", "young_modulus", False, True),
        ("found", "young_modulus", True, False),
        ("found", "gravity", False, False),
    ],
)
def test_modulus_alone_is_not_identifiable_or_named(
    verdict: str, named: str, not_identifiable: bool, right: bool
) -> None:
    assert scored("modulus", "young_modulus", verdict, named, not_identifiable).right is right


@pytest.mark.parametrize(
    ("verdict", "named", "right"),
    [
        ("found", "depth_bias", True),
        ("found", "camera_registration", True),
        ("found", "gravity", False),
        ("none", "", True),
        ("unexplained", "", False),
    ],
)
def test_a_fault_of_the_bench_has_its_own_names(verdict: str, named: str, right: bool) -> None:
    assert scored("fault", "WarmUp", verdict, named).right is right


@pytest.mark.parametrize(
    ("kind", "hidden", "verdict", "named", "first", "inside", "false_name"),
    [
        ("clear", "gravity", "found", "gravity", True, True, False),
        ("clear", "gravity", "found", "gravity tool_offset", True, True, True),
        ("clear", "gravity", "ambiguous", "tool_offset gravity", False, True, False),
        ("clear", "gravity", "ambiguous", "tool_offset tool_radius", False, False, True),
        ("clear", "gravity", "none", "", False, False, False),
        ("pair", "gravity tool_offset", "found", "gravity", True, False, False),
        ("control", "", "ambiguous", "gravity tool_offset", False, False, True),
        ("outside", "camera_drift", "ambiguous", "gravity tool_offset", False, False, False),
        ("outside", "camera_drift", "found", "gravity", False, False, True),
        ("modulus", "young_modulus", "found", "gravity", False, False, True),
        ("fault", "WarmUp", "found", "depth_bias", False, False, False),
        ("fault", "WarmUp", "found", "gravity", False, False, True),
    ],
)
def test_first_among_and_false_names(
    kind: str, hidden: str, verdict: str, named: str, first: bool, inside: bool, false_name: bool
) -> None:
    one = scored(kind, hidden, verdict, named)
    assert (one.first, one.inside, one.false_name) == (first, inside, false_name)


@pytest.mark.parametrize(
    ("kind", "hidden"), [("clear", "gravity"), ("control", ""), ("outside", "camera_drift")]
)
def test_case_that_ended_in_an_error_is_wrong_and_names_nothing(kind: str, hidden: str) -> None:
    one = result(kind, hidden, error="diagnosing it: SolveError: frame 3")
    assert not one.right and one.verdict == "error" and not one.named and not one.false_name
    assert (one.gain, one.bound, one.removed) == (0.0, 0.0, None)


def test_result_goes_to_a_row_and_back(tmp_path: Path) -> None:
    named = [cause("gravity", w=(2.0, 1.0, 3.0))]
    rows = [
        result("clear", "gravity", "found", named, name="a", size=4.5),
        result("control", error="x"),
    ]
    for one in rows:
        add_result(tmp_path / "results.jsonl", one)
    assert read_results(tmp_path / "results.jsonl") == rows


def test_last_row_that_was_torn_is_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    add_result(file, result("control", name="a"))
    whole = file.read_text()
    file.write_text(whole + whole[:40])
    assert [one.name for one in read_results(file)] == ["a"] and file.read_text() != whole
    assert [one.name for one in read_results(file, mend=True)] == [
        "a"
    ] and file.read_text() == whole
    add_result(file, result("control", name="b"))
    assert [one.name for one in read_results(file)] == ["a", "b"]


@pytest.mark.parametrize("broken", ["{", "[]", json.dumps({"name": "poisson_ratio-7", "seed": 7})])
def test_other_row_that_is_no_result_is_an_error_with_its_number(
    tmp_path: Path, broken: str
) -> None:
    file = tmp_path / "results.jsonl"
    add_result(file, result("control", name="a"))
    file.write_text(f"{broken}\n{file.read_text()}")
    with pytest.raises(RunError, match=r"results\.jsonl, row 1 is not a result"):
        read_results(file)
