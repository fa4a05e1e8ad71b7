"""Rows of the ranking and of the detection limits, as page, HTML report and terminal show them."""

from __future__ import annotations

from typing import Any

import pytest

from palpate.app.reporting.report_tables import chance, limit_rows, ranking_note, ranking_rows


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def report(verdict: str = "found", **others: Any) -> dict[str, Any]:
    return {
        "verdict": verdict,
        "causes": [{"effect": "time_offset", "probability": 1.0}],
        "gain": {"reducible_removed": {"value": 0.91}},
        "ranking": [
            {"effect": "tool_radius", "probability": 0.0, "error_removed": 0.047},
            {"effect": "gravity", "probability": 0, "error_removed": -0.2},
        ],
        **others,
    }


@pytest.mark.parametrize(
    ("probability", "text"),
    [
        (1.0, "> 99.9 %"), (0.9995, "> 99.9 %"), (0.996, "99.6 %"), (0.94, "94 %"),
        (0.0, "< 0.1 %"), (None, "–"),
    ],
)  # fmt: skip
def test_no_probability_is_said_to_be_certain(probability: float | None, text: str) -> None:
    assert plain(chance(probability)) == text


def test_the_named_cause_leads_the_ranking() -> None:
    first, second, third = ranking_rows(report())
    assert (first.effect, first.named, plain(first.removed)) == ("time_offset", True, "91 %")
    assert plain(first.probability) == "> 99.9 %"
    assert (second.effect, second.named, plain(second.removed)) == ("tool_radius", False, "5 %")
    assert third.share == 0.0
    listed = report(ranking=[{"effect": "time_offset", "probability": 0.97, "error_removed": 0.8}])
    (only,) = ranking_rows(listed)
    assert (plain(only.removed), plain(only.probability)) == ("80 %", "97 %")


def test_no_probability_stands_beside_a_cause_that_is_not_the_whole_one() -> None:
    refused = report(
        "unexplained",
        causes=[],
        ranking=[{"effect": "gravity", "probability": 0.89, "error_removed": 0.4}],
    )
    (row,) = ranking_rows(refused)
    assert row.probability == "–"
    assert "None of them is the whole cause" in ranking_note(refused)
    assert "how probable" in ranking_note(report())


def test_what_was_found_is_not_said_to_be_invisible_at_any_size() -> None:
    never = {"limits": [{"factor": None}], "typical": {"factor": None}, "at": {}, "alike": []}
    rows = limit_rows(
        report(ambiguity_map=[{"effect": "time_offset", **never}, {"effect": "gravity", **never}])
    )
    assert [row.size for row in rows] == ["the size that was found", "not at any size"]
    assert rows[0].like == "nothing else"


def test_limits_by_a_share_are_words_with_units() -> None:
    share = {"limits": [{"share": 0.349}], "typical": {"share": 0.349}}
    gravity = {
        "effect": "gravity",
        **share,
        "at": {"specific_weight_over_stiffness": {"value": 1.5, "unit": "1/m"}},
        "alike": [{"effect": "geometry_scale", "share": 0.64}],
    }
    stiffening = {
        "effect": "strain_stiffening", **share, "at": {"J_m": {"value": 6.0, "unit": "1"}},
        "alike": [],
    }  # fmt: skip
    one, other = limit_rows(report(ambiguity_map=[gravity, stiffening]))
    assert plain(one.size) == "35 % of the change by ρg/E 1.5 /m"
    assert plain(one.like) == "geometry scale (64 %)"
    assert plain(other.size) == "35 % of the change by chain limit J_m 6.0"
