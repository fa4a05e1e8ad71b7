from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from palpate.app.reporting.cause_phrases import cause_phrase
from palpate.app.reporting.sentences import (
    control_sentences,
    determined_sentences,
    left_sentences,
    limit_phrase,
    palpation_sentences,
    probe_sentence,
    verdict_sentence,
)
from palpate.effects import CATALOGUE, OUTSIDE, Effect, ToolRadius
from palpate.synthetic import HIDDEN, draw_scenario


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_verdict_names_size_place_and_gain(report: dict[str, Any]) -> None:
    assert plain(verdict_sentence(report, (0.0687, 0.0393, 0.0358))) == (
        "The simulation misses a stiff lump, 15 mm across, 10 mm under the top; "
        "naming it removes 93 % of the error that can be removed."
    )


def test_two_causes_are_named_in_one_sentence(report: dict[str, Any]) -> None:
    report["causes"].append(
        {"effect": "tool_radius", "parameters": {"radius": {"value": 0.0042, "unit": "m"}}}
    )
    sentence = plain(verdict_sentence(report))
    assert "across and the size of the tool: its radius is 4.2 mm; naming them removes" in sentence


@pytest.mark.parametrize(
    ("verdict", "words"),
    [("none", "misses nothing"), ("unexplained", "no known effect"), ("ambiguous", "equally well")],
)
def test_other_verdicts_say_so(report: dict[str, Any], verdict: str, words: str) -> None:
    assert words in verdict_sentence({**report, "verdict": verdict})


def test_a_hint_is_in_the_verdict_and_nothing_is_said_to_be_missed_by_none() -> None:
    rows: list[dict[str, Any]] = [
        {"effect": "stiff_inclusion", "hint": "would explain the data by 39 nats"},
        {"effect": "gravity"},
    ]
    small = {"rms_mm": 0.054, "share_of_motion": 0.13, "tolerance_mm": 0.1}
    none: dict[str, Any] = {"verdict": "none", "ranking": rows}
    assert plain(verdict_sentence(none)) == (
        "No cause is sure enough to be named; stiff inclusion is a hint."
    )
    assert plain(verdict_sentence({**none, "small_remainder": small})) == (
        "No cause is sure enough to be named; stiff inclusion is a hint: "
        "what it may explain is within the tolerance of 0.10 mm."
    )
    rows[1]["hint"] = "would explain the data by 30 nats"
    assert "stiff inclusion and gravity are hints" in plain(verdict_sentence(none))
    told = verdict_sentence({"verdict": "none", "ranking": [], "small_remainder": small})
    assert "nothing that matters" in told and "tolerance" in told


def test_what_is_left_is_told_with_place_and_time(report: dict[str, Any]) -> None:
    left = {
        "fraction": 0.55,
        "where": "12 % of it within 8 mm of (-34, -10, 34) mm",
        "when": "most in poke-side-02",
    }
    place = ["Where: 12 % of it within 8 mm of (-34, -10, 34) mm.", "When: most in poke-side-02."]
    assert left_sentences({**report, "causes": [], "unexplained": left}) == place
    share, *same = left_sentences({**report, "unexplained": left})
    assert (plain(share), same) == ("55 % of the structured error is left.", place)
    assert left_sentences({**report, "unexplained": {**left, "fraction": 0.0}}) == []
    assert left_sentences({**report, "unexplained": None}) == []


def test_family_is_said_where_its_laws_are_not_told_apart(report: dict[str, Any]) -> None:
    family = {
        "name": "memory",
        "sure": "the material remembers",
        "parted_by": "frames after a release",
        "members": [
            {"effect": "viscoelasticity", "left": 0.32},
            {"effect": "permanent_set", "left": 0.46},
        ],
    }
    told = verdict_sentence({**report, "verdict": "ambiguous", "family": family})
    assert told.replace("\xa0", " ") == (
        "The material remembers; by which law is open: viscoelasticity leaves 32 % of the error, "
        "permanent set leaves 46 % of the error. What would tell: frames after a release."
    )


def test_clues_to_an_unexplained_error_are_told(report: dict[str, Any]) -> None:
    clues = {
        "rms_mm_when": {"while the tool touches": 0.21, "after a release": 0.02},
        "grows_with_push": 1.4,
        "moves_with": {"the whole view": 0.04, "the tool": 0.62},
        "worst_frames": [{"sequence": "drag-01", "time_s": 33.687, "rms_mm": 0.3}],
        "partial_causes": [{"effects": ["tool_radius"], "gain_nats": 30.0, "left": 0.55}],
        "measure_next": "measure the tool",
    }
    left = {"fraction": 0.4, "where": "here", "when": "then", "clues": clues}
    told = " ".join(left_sentences({**report, "unexplained": left})).replace("\xa0", " ")
    assert "while the tool touches 0.21 mm" in told
    assert "Moves with: the tool 62 %, the whole view 4 %." in told
    assert "Worst frames: drag-01 at 33.69 s." in told
    assert "Partial causes: tool radius leaves 55 %." in told
    assert "Next: measure the tool." in told


def test_every_effect_of_the_catalogue_has_its_own_words() -> None:
    own = [effect for effect in CATALOGUE if effect not in OUTSIDE]
    assert [effect.name for effect in own if "phrase" not in vars(effect)] == []


def test_effect_without_words_of_its_own_is_said_by_its_summary() -> None:
    phrase = vars(Effect)["phrase"].__func__
    assert phrase(ToolRadius, {}) == f"that {ToolRadius.summary}"


def test_cause_of_an_effect_that_is_not_installed_is_named() -> None:
    assert cause_phrase({"effect": "my_vessel", "parameters": {}}) == "an effect called my vessel"


def test_every_effect_the_bench_can_hide_has_its_own_words() -> None:
    drawn = {
        hidden.effect: hidden
        for seed in range(120)
        for hidden in draw_scenario(seed, among=list(HIDDEN)).effects
    }
    assert set(drawn) == set(HIDDEN)
    for hidden in drawn.values():
        parameters = {name: {"value": value} for name, value in hidden.parameters.items()}
        assert "an effect called" not in cause_phrase(
            {"effect": hidden.effect, "parameters": parameters}, (0.07, 0.04, 0.036)
        )


@pytest.mark.parametrize(
    ("pairing", "words"),
    [
        ("as-paired", "than stated: 0.87 times as far apart, 1.2 mm inside"),
        ("swap-1-3", "rows 1 and 3 were taken for each other, 0.87 times"),
        ("turn-2", "each row is of the landmark 2 further on"),
        ("reversed", "the rows are in the reverse order"),
    ],
)
def test_pairing_is_said_by_the_rows_of_the_file(pairing: str, words: str) -> None:
    values = {"pairing": pairing, "scale": 0.87, "inset": 1.2e-3}
    cause = {
        "effect": "landmark_mismatch",
        "parameters": {name: {"value": value} for name, value in values.items()},
    }
    assert words in plain(cause_phrase(cause))


def test_grid_that_is_too_coarse_is_said_with_the_edge_that_would_do() -> None:
    cause = {"effect": "mesh_resolution", "parameters": {"element_size": {"value": 2e-3}}}
    assert "too coarse, 2.0 mm would do" in plain(cause_phrase(cause))
    row = {
        "effect": "mesh_resolution",
        "limits": [{"share": 1.5}],
        "typical": {"share": 1.5},
        "at": {"element_size": {}},
    }
    assert (
        plain(limit_phrase({**row, "at": {}}))
        == "1.5 times the change from the replay's mesh to a finer one"
    )


def test_what_no_shape_tells_of_is_judged_by_the_force(report: dict[str, Any]) -> None:
    stiffer = {"effect": "young_modulus", "parameters": {"E": {"value": 7512.0, "unit": "Pa"}}}
    gain = {
        **report["gain"],
        "force": {"unit": "N", "baseline": 0.0712, "extended": 0.0051, "noise_floor": 0.005},
    }
    assert plain(verdict_sentence({**report, "causes": [stiffer], "gain": gain})) == (
        "The simulation misses another stiffness: Young's modulus is 7.5 kPa; "
        "naming it brings the error of the force on the test sequences from 0.071 N to 0.0051 N."
    )


def test_effect_of_somebody_else_is_called_by_its_name() -> None:
    assert (
        cause_phrase({"effect": "frozen_core", "parameters": {}}) == "an effect called frozen core"
    )


def test_report_on_disk_and_sentence_need_no_more_than_json(
    report: dict[str, Any], tmp_path: Path
) -> None:
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert verdict_sentence(json.loads((tmp_path / "report.json").read_text())) == verdict_sentence(
        report
    )


@pytest.mark.parametrize(
    ("limits", "typical", "at", "words"),
    [
        ([{"parameter": "radius", "unit": "m", "change": 1.24e-4}], {}, {}, "0.12 mm"),
        (
            [
                {"parameter": "tx", "unit": "m", "change": 1e-4},
                {"parameter": "ty", "unit": "m", "change": 2e-4},
                {"parameter": "rx", "unit": "rad", "change": 0.01},
            ],
            {},
            {},
            "0.20 mm, 0.57°",
        ),
        (
            [{"parameter": "stiffness_ratio", "unit": "1", "factor": 1.4}],
            {"parameter": "stiffness_ratio", "unit": "1", "factor": 2.6},
            {"x": {"value": 0.01, "unit": "m"}},
            "1.4 times where it shows best, 2.6 times at half of the places",
        ),
        (
            [{"parameter": "stiffness_ratio", "unit": "1", "factor": 1.4}],
            {"parameter": "stiffness_ratio", "unit": "1", "factor": None},
            {"x": {"value": 0.01, "unit": "m"}},
            "1.4 times where it shows best, at half of the places not at any size",
        ),
        (
            [{"parameter": "E", "unit": "Pa", "factor": 1.26}],
            {"parameter": "E", "unit": "Pa", "factor": 1.26},
            {},
            "1.3 times",
        ),
        (
            [{"parameter": "stiffness_ratio", "unit": "1", "factor": 1.3}],
            {"parameter": "stiffness_ratio", "unit": "1", "factor": 1.6},
            {"thickness": {"value": 0.002, "unit": "m"}},
            "1.3 times at thickness 2.0 mm",
        ),
        (
            [{"share": 0.45}],
            {"share": 0.5},
            {"edge": {"value": "-x", "unit": ""}, "extent": {"value": 0.014, "unit": "m"}},
            "45 % of the change by edge -x, extent 14 mm",
        ),
        ([{"share": None}], {"share": None}, {}, "not at any size"),
    ],
    ids=[
        "change",
        "worst of each unit",
        "factor",
        "hidden places",
        "no place",
        "skin",
        "share",
        "never",
    ],
)
def test_limits_are_said_in_words(
    limits: list[Any], typical: Any, at: dict[str, Any], words: str
) -> None:
    assert plain(limit_phrase({"limits": limits, "typical": typical, "at": at})) == words


def test_controls_say_what_is_left_of_the_gain(report: dict[str, Any]) -> None:
    passed, failed = (plain(said) for said in control_sentences(report["controls"]))
    assert passed == "with the clock shifted, stiff inclusion keeps 1 % of its gain at most"
    assert failed.startswith(
        "with the geometry mirrored, stiff inclusion still keeps 70 % of its gain"
    )
    (nothing,) = control_sentences(report["controls"][2:])
    assert (
        nothing.startswith("none says anything of stiff inclusion: with these motions")
        and control_sentences([]) == []
    )


def test_next_probe_says_what_to_do_and_what_it_tells(report: dict[str, Any]) -> None:
    pushed, measured = (plain(probe_sentence(row)) for row in report["next_probe"])
    assert (
        pushed
        == "press 6 mm deep on the top at (12, -8) mm: tells stiff inclusion from tool radius, "
        "94 % likely to decide"
    )
    assert "more than 99 % likely" in plain(
        probe_sentence({**report["next_probe"][0], "probability": 0.999})
    )
    assert measured == "measure the block with a calliper: tells gravity from geometry scale"


def test_parameters_that_the_data_do_not_enclose_are_named(report: dict[str, Any]) -> None:
    (cause,) = report["causes"]
    assert determined_sentences([cause]) == []
    ratio = {"value": 9.0, "unit": "1", "low": 4.1, "high": 20.0}
    for told, words in {
        "at least": "at least 4.1",
        "at most": "at most 20",
        "not identifiable": "not identifiable from",
    }.items():
        parameters = {
            "stiffness_ratio": {**ratio, "identifiability": told},
            "x": {**ratio, "identifiability": "interval"},
        }
        (said,) = determined_sentences([{**cause, "parameters": parameters}])
        assert said.startswith(f"stiff inclusion stiffness ratio is {words}")


def test_lump_that_was_felt_is_said_with_its_depth_footprint_and_cover() -> None:
    lengths = {"x": 0.004, "y": 0.0, "z": 0.02, "radius": 0.0075}
    parameters = {name: {"value": value, "unit": "m"} for name, value in lengths.items()}
    parameters["stiffness_ratio"] = {"value": 6.0, "unit": "1"}
    cause = {
        "effect": "stiff_inclusion",
        "parameters": parameters,
        "depth": {"value": 0.0113, "unit": "m", "low": 0.0094, "high": 0.0131},
        "cover": {"value": 0.0038, "unit": "m", "low": 0.003, "high": 0.005},
        "footprint": {"middle": [0.004, -0.001, 0.0313], "area": 3.2e-4},
    }
    palpation = {
        "pushes": 15,
        "depth": {"value": 0.004, "unit": "m"},
        "force": {"value": 0.12, "unit": "N"},
    }
    report = {"verdict": "found", "causes": [cause], "palpation": palpation}
    assert plain(verdict_sentence(report)) == (
        "The simulation misses a stiff lump, 15 mm across, "
        "its centre 11.3 mm (9.4 to 13.1) under the surface."
    )
    pushed, felt, cover = (plain(said) for said in palpation_sentences(report))
    assert pushed == "15 pushes, about 4.0 mm deep, against about 0.12 N"
    assert felt == "it is felt over 3.2 cm² of the surface around (4.0 mm, -1.0 mm, 31 mm)"
    assert cover == "3.8 mm (3.0 to 5.0) of tissue lie above it"
    assert palpation_sentences({"causes": [cause]}) == []
