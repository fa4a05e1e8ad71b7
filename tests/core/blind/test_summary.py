"""Figures of results made by hand, whose answers are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from blind_results import cause, result

from palpate.blind import CaseResult, summary_of
from palpate.blind.calibration import brier, calibration_error, first_effect, reliability
from palpate.blind.parameter_errors import (
    ReportedParameter,
    coverage,
    distances,
    parameter_errors,
    reported_parameters,
)
from palpate.blind.proportions import median_of, rate
from palpate.blind.targets import TARGETS, grade, judge_targets
from palpate.effects import DIAGNOSED, Parameter, effect_named
from palpate.synthetic import HIDDEN


def target(key: str, results: list[CaseResult]) -> dict[str, object]:
    return next(row for row in judge_targets(results) if row["key"] == key)


def test_share_has_the_interval_of_clopper_and_pearson() -> None:
    none, all_of_them = rate(0, 50), rate(50, 50)
    assert (
        none.value == 0.0 and none.low == 0.0 and none.high == pytest.approx(1 - 0.025 ** (1 / 50))
    )
    assert all_of_them.low == pytest.approx(0.025 ** (1 / 50)) and all_of_them.high == 1.0
    assert rate(0, 0).value is None


def test_median_has_an_interval_between_order_statistics() -> None:
    found = median_of([float(one) for one in range(1, 101)])
    assert found.value == 50.5
    assert (
        found.low is not None
        and found.high is not None
        and 40 <= found.low <= 41
        and 60 <= found.high <= 61
    )
    assert median_of([3.0, 1.0]).low is None and median_of([]).value is None


def said(
    effect: str,
    name: str,
    true: float,
    value: float,
    low: float,
    high: float,
    item: Parameter | None = None,
) -> ReportedParameter:
    return ReportedParameter("case", "clear", effect, name, "1", true, value, low, high, 0.95, item)


def test_interval_is_narrowed_as_a_normal_distribution_has_it() -> None:
    # 0.9 of a normal distribution is within 1.645 deviations, 0.95 within 1.960.
    edge = said("poisson_ratio", "nu", 0.3 + 0.0170, 0.3, 0.28, 0.32)
    assert edge.covers() is True and edge.covers(0.9) is False
    assert replace(edge, true=0.3 + 0.0167).covers(0.9) is True
    assert replace(edge, low=None).covers() is None


def test_interval_of_a_parameter_that_is_searched_by_its_logarithm_is_narrowed_there() -> None:
    wide = said(
        "surface_layer",
        "stiffness_ratio",
        4.0,
        4.0,
        1.0,
        16.0,
        effect_named("surface_layer").numbers()[1],
    )
    narrowed = 4.0 ** (1.6449 / 1.96)
    assert replace(wide, true=4.0 * narrowed * 0.99).covers(0.9) and not replace(
        wide, true=4.0 * narrowed * 1.01
    ).covers(0.9)
    assert replace(wide, true=4.0 / narrowed * 1.01).covers(0.9) and not replace(
        wide, true=4.0 / narrowed * 0.99
    ).covers(0.9)


AXIS = effect_named("anisotropy").numbers()[0]


def test_direction_comes_round_at_half_a_turn() -> None:
    fibres = said(
        "anisotropy", "direction", 0.02, math.pi - 0.01, math.pi - 0.1, math.pi + 0.1, AXIS
    )
    assert fibres.error == pytest.approx(-0.03) and fibres.covers()
    assert said("time_offset", "offset", 0.02, math.pi - 0.01, 3.0, 3.3).error == pytest.approx(
        math.pi - 0.03
    )


def inclusion(
    x: float, y: float, z: float, at: tuple[float, float, float], name: str
) -> CaseResult:
    said = {
        key: (value, value - 1e-3, value + 1e-3)
        for key, value in zip("xyz", (x, y, z), strict=True)
    }
    named = cause("stiff_inclusion", 0.99, **said)
    truth = dict(zip("xyz", at, strict=True))
    return result("clear", "stiff_inclusion", "found", [named], name=name, truth=truth)


def test_errors_are_of_what_is_named_and_hidden_alone() -> None:
    missed = result(
        "clear", "stiff_inclusion", "found", [cause("gravity", x=(1.0, 0.9, 1.1))], truth={"x": 0.0}
    )
    found = inclusion(3e-3, 4e-3, 0.02, (0.0, 0.0, 0.022), "a")
    table = parameter_errors(reported_parameters([found, missed]))
    assert list(table) == ["stiff_inclusion.x", "stiff_inclusion.y", "stiff_inclusion.z"]
    assert table["stiff_inclusion.z"]["median"]["value"] == pytest.approx(2e-3)
    assert table["stiff_inclusion.z"]["mean_signed"] == pytest.approx(-2e-3)
    assert distances([found, missed], "stiff_inclusion", ("x", "y")) == [pytest.approx(5e-3)]


def test_median_of_an_inclusions_place_is_judged() -> None:
    off = [inclusion(size, 0.0, 0.02, (0.0, 0.0, 0.02), str(size)) for size in (1e-3, 2e-3, 9e-3)]
    judgement = target("inclusion.plane", off)
    assert (
        judgement["met"] is True and judgement["at_most"] == 2.5e-3 and judgement["sure"] is False
    )
    assert target("inclusion.plane", off[2:])["met"] is False


def test_word_is_right_or_wrong() -> None:
    named = cause("base_detachment")
    named["parameters"]["edge"] = {"value": "+x", "unit": ""}
    rows = [
        result("clear", "base_detachment", "found", [named], truth={"edge": edge})
        for edge in ("+x", "+x", "-y")
    ]
    assert summary_of(rows, 0)["words"]["base_detachment.edge"]["hits"] == 2


def test_coverage_counts_intervals_and_not_cases() -> None:
    held = inclusion(0.0, 0.0, 0.02, (0.0, 0.0, 0.0215), "a")
    assert (
        coverage(reported_parameters([held])).hits,
        coverage(reported_parameters([held])).n,
    ) == (2, 3)


def test_numbers_that_were_never_written_cover_as_those_of_a_file_do() -> None:
    one = inclusion(0.0, 0.0, 0.02, (0.0, 0.0, 0.02), "a")
    (cause,) = one.causes
    numbers = cause["parameters"].items()
    fresh = {
        name: {key: np.float64(v) if isinstance(v, float) else v for key, v in entry.items()}
        for name, entry in numbers
    }
    said = replace(one, report=one.report | {"causes": [cause | {"parameters": fresh}]})
    assert (
        coverage(reported_parameters([said])).hits,
        coverage(reported_parameters([one])).hits,
    ) == (3, 3)


def test_stated_level_of_a_report_is_taken() -> None:
    one = inclusion(0.0, 0.0, 0.02, (0.95e-3, 0.0, 0.02), "a")
    stated = replace(one, report=one.report | {"interval_level": 0.9})
    assert [coverage(reported_parameters([each]), 0.9).hits for each in (one, stated)] == [2, 3]


def test_calibrated_probabilities_have_no_error_and_overconfident_ones_have_it() -> None:
    true = np.array([1.0] * 8 + [0.0] * 2)
    assert calibration_error(np.full(10, 0.8), true).value == pytest.approx(0.0)
    assert calibration_error(np.full(10, 0.95), true).value == pytest.approx(0.15)
    assert brier(np.full(10, 0.8), true).value == pytest.approx(0.16)
    (row,) = reliability(np.full(10, 0.8), true)
    assert (row["low"], row["stated"], row["true"]["hits"], row["true"]["n"]) == (
        0.8,
        pytest.approx(0.8),
        8,
        10,
    )


def test_most_probable_effect_counts_whether_it_is_named_or_not() -> None:
    rows = [
        result("clear", "gravity", "found", [cause("gravity", 0.9)], ranking={"tool_radius": 0.1}),
        result("subtle", "gravity", "none", ranking={"gravity": 0.4, "tool_radius": 0.3}),
        result("control", ranking={"gravity": 0.2, "tool_radius": 0.3}),
        result("control", error="out of memory"),
    ]
    stated, true = first_effect(rows)
    assert stated.tolist() == [0.9, 0.4, 0.3] and true.tolist() == [1.0, 1.0, 0.0]


def test_size_over_the_limit_grades_a_case() -> None:
    sizes = (None, 1.9, 2.0, 4.9, 5.0)
    rows = [result("subtle", "gravity", "found", [cause("gravity")], size=size) for size in sizes]
    assert [grade(row) for row in rows] == ["", "faint", "subtle", "subtle", "clear"]
    reached = {
        key: target(key, rows)["reached"] for key in ("limit_clear.first", "limit_subtle.first")
    }
    assert [one["n"] for one in reached.values()] == [1, 2]  # type: ignore[index]


@pytest.mark.parametrize(
    ("named", "met", "sure"),
    [(0, True, False), (1, True, False), (2, False, False), (20, False, True)],
)
def test_of_fifty_controls_one_false_alarm_is_let_through(
    named: int, met: bool, sure: bool
) -> None:
    rows = [
        result(
            "control", "", "found" if one < named else "none", [cause("gravity")] * (one < named)
        )
        for one in range(50)
    ]
    judgement = target("control.named", rows)
    assert (judgement["met"], judgement["sure"]) == (met, sure)


def test_band_is_missed_on_both_sides() -> None:
    band = next(one for one in TARGETS if one.key == "coverage")
    for hits, met in ((840, False), (860, True), (940, True), (960, False)):
        judgement = replace(band, measure=lambda _, hits=hits: rate(hits, 1000)).judge([])  # type: ignore[misc]
        assert judgement["met"] is met
    assert replace(band, measure=lambda _: rate(4, 5)).judge([])["sure"] is False


def test_case_that_names_nothing_or_fails_removes_nothing() -> None:
    rows = [result("clear", "gravity", "found", [cause("gravity")], removed=0.9) for _ in range(2)]
    rows += [
        result("clear", "gravity", removed=None),
        result("clear", "gravity", error="x"),
        result("clear", "gravity", removed=0.0),
    ]
    assert target("removed", rows)["reached"]["value"] == 0.0  # type: ignore[index]


def test_summary_says_what_was_named_for_what() -> None:
    rows = [
        result("clear", "gravity", "found", [cause("gravity")]),
        result("clear", "gravity", "found", [cause("gravity"), cause("tool_radius")]),
        result("subtle", "gravity", "ambiguous", [cause("gravity"), cause("tool_radius")]),
        result("control", error="x"),
        result("outside", "camera_drift", "unexplained"),
        result("pair", "gravity tool_radius", "found", [cause("gravity")]),
        result("pair", "gravity tool_radius", "found", [cause("gravity"), cause("tool_radius")]),
        result("pair", "gravity tool_radius", "found", [cause("gravity"), cause("time_offset")]),
    ]
    found = summary_of(rows, seed=3)
    assert found["confusion"] == {
        "gravity": {"gravity": 1, "several": 1, "ambiguous": 1},
        "nothing": {"error": 1},
        "camera_drift": {"unexplained": 1},
    }
    assert found["pairs"] == {"one named": 1, "both named": 1, "one named, and another": 1}
    assert (found["seed"], found["cases"], found["code"], found["errors"]) == (
        3,
        8,
        {"abc": 8},
        {"case": "x"},
    )
    assert (
        found["kinds"]["pair"]["exact"]["hits"] == 1
        and found["kinds"]["clear"]["false_name"]["hits"] == 1
    )


def test_summary_of_nothing_has_no_figures() -> None:
    found = summary_of([], 0)
    assert all(row["met"] is None for row in found["targets"])


def test_targets_on_parameters_name_what_the_catalogue_has() -> None:
    names = {
        "stiff_inclusion": "xyz",
        "tool_radius": ["radius"],
        "time_offset": ["offset"],
        "poisson_ratio": ["nu"],
    }
    assert all(set(own) <= set(HIDDEN[effect]) for effect, own in names.items())
    camera = next(effect for effect in DIAGNOSED if effect.name == "camera_registration")
    assert [item.name for item in camera.numbers()] == ["tx", "ty", "tz", "rx", "ry", "rz"]
