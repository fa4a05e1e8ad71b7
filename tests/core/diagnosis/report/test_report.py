from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from noisy_model import LUMP, RADIUS, noisy_model, stated_evaluator
from small_dataset import write_valid_dataset

from palpate.dataset import Dataset, open_dataset
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.gain.surface_gain import SurfaceGain
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.noise.camera_error_model import Ripple
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.report.report import report_of, verdict_of
from palpate.diagnosis.search.chance_gains import ChanceGains
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.validation.checks import AllClearChecks
from palpate.diagnosis.validation.held_out_check import HeldOutCheck
from palpate.diagnosis.validation.rejection import rejection_reason
from palpate.diagnosis.validation.stiffness_error_test import StiffnessErrorTest
from palpate.diagnosis.validation.worst_location import ErrorLocation
from palpate.effects import DIAGNOSED, Effect
from palpate.effects.elastic_material import PoissonRatio
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity

NU = PoissonRatio(nu=0.40)
RIM = ErrorLocation((0.03, 0.0, 0.039), 0.4)
LADDER = SurfaceGain(
    baseline=1.92e-3,
    extended=0.61e-3,
    noise_floor=0.55e-3,
    removed=(0.956, 0.93, 0.98),
    paper=(2.4e-3, 1.3e-3),
    probes=9,
)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Two sequences, one of them without forces."""
    return open_dataset(write_valid_dataset(tmp_path_factory.mktemp("data") / "small-block"))


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with stated_evaluator() as found:
        yield found


Tried = tuple[tuple[Effect, ...], float, float]

OF_A_BLOCK = {kind.name for kind in DIAGNOSED if not kind.needs_shape}


def _findings(
    evaluator: Evaluator, *trials: Tried, accepted: bool = True, misfit: float = 2.0
) -> Findings:
    """Trials as (effects, gain, misfit left), best first; the first is accepted or not."""
    made = [
        Trial(noisy_model(evaluator, *effects), gain, left, required_gain=12.0 * len(effects))
        for effects, gain, left in trials
    ]
    screened = {kind.name: 0.5 * number for number, kind in enumerate(DIAGNOSED)}
    return Findings(
        noisy_model(evaluator), made[0] if accepted and made else None, made, 12.0, misfit, screened
    )


def test_one_cause_far_ahead_is_found(evaluator):
    assert (
        verdict_of(
            _findings(
                evaluator,
                ((LUMP,), 90.0, 1.05),
                ((RADIUS,), 90.0 - 1.1 * CRITERIA.naming.rival, 1.4),
            )
        )
        == "found"
    )


def test_two_causes_about_as_good_are_ambiguous(evaluator):
    assert (
        verdict_of(
            _findings(
                evaluator,
                ((LUMP,), 90.0, 1.05),
                ((RADIUS,), 90.0 - 0.9 * CRITERIA.naming.rival, 1.1),
            )
        )
        == "ambiguous"
    )


def test_same_cause_from_another_start_is_no_rival(evaluator):
    assert verdict_of(_findings(evaluator, ((LUMP,), 90.0, 1.05), ((LUMP,), 89.0, 1.1))) == "found"


def test_part_of_a_pair_is_no_rival(evaluator):
    assert (
        verdict_of(_findings(evaluator, ((LUMP, RADIUS), 90.0, 1.05), ((LUMP,), 89.0, 1.1)))
        == "found"
    )


@pytest.mark.parametrize(
    ("left", "wanted"), [(1.02, "none"), (CRITERIA.verdict.unexplained_misfit + 0.2, "unexplained")]
)
def test_without_a_cause_it_depends_on_what_is_left(evaluator, left, wanted):
    assert (
        verdict_of(_findings(evaluator, ((LUMP,), 3.0, 1.0), accepted=False, misfit=left)) == wanted
    )
    assert verdict_of(_findings(evaluator, accepted=False, misfit=left)) == wanted


def test_structured_error_without_a_cause_is_unexplained(evaluator):
    findings = _findings(evaluator, accepted=False, misfit=1.02)
    findings.structure = findings.remaining = Structure(50.0, 20.0, 30.0)
    assert verdict_of(findings) == "unexplained"
    findings.structure = findings.remaining = Structure(29.0, 20.0, 30.0)
    assert verdict_of(findings) == "none"


def test_rippled_depth_is_reported_and_is_no_noise(evaluator, dataset):
    findings = _findings(evaluator, misfit=1.0)
    assert verdict_of(findings) == "none"
    findings.ripple = Ripple(size=2e-4, reach=4e-3, gain=80.0, share=0.3)
    report = report_of(dataset, evaluator, findings, LADDER, "test")
    assert (report["verdict"], report["causes"], report["unexplained"]["fraction"]) == (
        "unexplained",
        [],
        0.3,
    )
    assert "rest.ply" in report["unexplained"]["where"]
    assert any(
        "waves with the distance from the camera, by about 0.2 mm" in text
        for text in report["warnings"]
    )


def test_error_in_held_out_sequences_alone_is_unexplained(evaluator, dataset):
    findings = _findings(evaluator, misfit=1.0)
    held_out = HeldOutCheck(noisy_model(evaluator), Structure(20.0, 20.0, 30.0))
    checks = AllClearChecks(held_out=held_out)
    clear = report_of(dataset, evaluator, findings, LADDER, "test", checks)
    assert (clear["verdict"], clear["unexplained"]["fraction"]) == ("none", 0.0)
    assert (
        clear["evidence"]["held_out_structure"],
        clear["evidence"]["held_out_structure_bound"],
    ) == (1.0, 1.5)
    held_out = HeldOutCheck(noisy_model(evaluator), Structure(50.0, 20.0, 30.0))
    checks = AllClearChecks(held_out=held_out)
    report = report_of(dataset, evaluator, findings, LADDER, "test", checks)
    assert (report["verdict"], report["causes"], report["unexplained"]["fraction"]) == (
        "unexplained",
        [],
        0.6,
    )
    assert report["unexplained"]["when"] == "most in poke-02, on which nothing was fitted"


def test_structured_error_within_the_tolerance_is_a_small_remainder(evaluator, dataset):
    findings = _findings(evaluator, accepted=False, misfit=1.02)
    findings.structure = findings.remaining = Structure(50.0, 20.0, 30.0, 0.07e-3, 3e-3)
    report = report_of(dataset, evaluator, findings, LADDER, "test")
    assert (report["verdict"], report["unexplained"]["fraction"]) == ("none", 0.0)
    small = report["small_remainder"]
    assert (small["rms_mm"], small["share_of_motion"], small["tolerance_mm"]) == (0.07, 0.0233, 0.1)
    assert small["when"] == "most in poke-02" and small["where"]
    findings.tolerance = Tolerance(0.05e-3)
    checks = AllClearChecks(tolerance=findings.tolerance)
    report = report_of(dataset, evaluator, findings, LADDER, "test", checks)
    assert (report["verdict"], report["small_remainder"]) == ("unexplained", None)
    assert report["unexplained"]["rms_mm"] == 0.07


def test_local_stiffness_within_the_tolerance_is_a_small_remainder(evaluator, dataset):
    findings = _findings(evaluator, misfit=1.0)
    name = findings.baseline.predictions[-1].name
    one = StiffnessErrorTest(name, 4.0, 13.2, 6.0, RIM, 0.05e-3, 2e-3)
    report = report_of(dataset, evaluator, findings, LADDER, "test", AllClearChecks(one))
    assert report["verdict"] == "none"
    assert report["small_remainder"]["when"] == f"most in {name}"
    assert not any("local stiffness" in text for text in report["warnings"])


def test_hint_stands_in_the_ranking(evaluator, dataset):
    findings = _findings(evaluator, ((RADIUS,), 31.0, 1.0))
    findings.withdraw("tool_radius is a hint")
    rows = report_of(dataset, evaluator, findings, LADDER, "test")["ranking"]
    assert [row["effect"] for row in rows if "hint" in row] == ["tool_radius"]


def test_sequence_with_unusual_engine_error_is_unexplained(evaluator, dataset):
    findings = _findings(evaluator, misfit=1.0)
    name = findings.baseline.predictions[-1].name
    checks = AllClearChecks(StiffnessErrorTest(name, 1.2, 0.5, 6.0, RIM))
    clear = report_of(dataset, evaluator, findings, LADDER, "test", checks)
    assert (
        clear["verdict"] == "none"
        and clear["evidence"]["local_stiffness_error"][0]["sequence"] == name
    )
    checks = AllClearChecks(StiffnessErrorTest(name, 4.0, 13.2, 6.0, RIM))
    report = report_of(dataset, evaluator, findings, LADDER, "test", checks)
    assert (report["verdict"], report["causes"], report["unexplained"]["fraction"]) == (
        "unexplained",
        [],
        0.9375,
    )
    assert report["unexplained"]["when"] == f"most in {name}"
    assert report["unexplained"]["where"] == "40 % of it within 8 mm of (30, 0, 39) mm"
    assert report["warnings"][-1].startswith(
        f"{name} would need local stiffness that is off by 16 %"
    )


def test_held_out_sequence_with_unusual_engine_error_is_unexplained(evaluator, dataset):
    findings = _findings(evaluator, misfit=1.0)
    other = noisy_model(evaluator)
    held_out = HeldOutCheck(
        other,
        Structure(20.0, 20.0, 30.0),
        StiffnessErrorTest(other.predictions[-1].name, 4.0, 13.2, 6.0, RIM),
    )
    checks = AllClearChecks(StiffnessErrorTest("poke-01", 1.0, 0.0, 6.0, RIM), held_out)
    report = report_of(dataset, evaluator, findings, LADDER, "test", checks)
    assert report["verdict"] == "unexplained"
    assert (
        report["unexplained"]["when"]
        == f"most in {other.predictions[-1].name}, on which nothing was fitted"
    )


def test_cause_is_named_beside_rippled_depth(evaluator, dataset):
    findings = _findings(evaluator, ((RADIUS,), 60.0, 1.0))
    findings.ripple = Ripple(size=2e-4, reach=4e-3, gain=80.0, share=0.3)
    report = report_of(dataset, evaluator, findings, LADDER, "test")
    assert report["verdict"] == "found"
    assert any("waves with the distance" in text for text in report["warnings"])


def test_report_keeps_the_contract(evaluator, dataset):
    findings = _findings(evaluator, ((LUMP,), 90.0, 1.05), ((RADIUS,), 40.0, 1.5))
    report = report_of(dataset, evaluator, findings, LADDER, "test")
    assert json.loads(json.dumps(report)) == report
    assert (report["format"], report["dataset"], report["verdict"]) == (1, "small-block", "found")
    assert report["criteria"] == {"version": CRITERIA.version}
    (cause,) = report["causes"]
    assert cause["effect"] == "stiff_inclusion" and cause["probability"] > 0.99
    assert set(cause["parameters"]) == {"x", "y", "z", "radius", "stiffness_ratio"}
    assert all(
        {"value", "unit", "low", "high"} == set(entry) for entry in cause["parameters"].values()
    )
    assert {row["effect"] for row in report["ranking"]} == OF_A_BLOCK - {"stiff_inclusion"}
    assert all({"effect", "probability", "error_removed"} <= set(row) for row in report["ranking"])
    assert report["ranking"][0]["effect"] == "tool_radius" and report["ranking"][0][
        "error_removed"
    ] == pytest.approx(0.5)
    assert {"fraction", "where", "when"} <= set(report["unexplained"])
    assert report["warnings"] == ["the touches disagree"]
    assert report["gain"] == {
        "split": "test",
        "unit": "mm",
        "baseline": 1.92,
        "extended": 0.61,
        "noise_floor": 0.55,
        "reducible_removed": {"value": 0.956, "low": 0.93, "high": 0.98},
        "paper_metric": {"baseline": 2.4, "extended": 1.3},
        "probes": 9,
    }


def test_stiffness_is_not_identifiable_without_forces(evaluator, dataset):
    report = report_of(
        dataset, evaluator, _findings(evaluator, accepted=False, misfit=1.0), None, "test"
    )
    (entry,) = report["not_identifiable"]
    assert report["identified"] == []
    assert entry["effect"] == "young_modulus"
    assert "force" in entry["measure_instead"] and entry["why"]


def test_report_without_a_cause_names_none(evaluator, dataset):
    report = report_of(
        dataset,
        evaluator,
        _findings(evaluator, ((LUMP,), 2.0, 1.0), accepted=False, misfit=1.0),
        None,
        "test",
    )
    assert report["verdict"] == "none" and report["causes"] == [] and report["gain"] is None
    assert len(report["ranking"]) == len(OF_A_BLOCK)


def test_cause_that_makes_held_out_sequences_worse_is_rejected(evaluator, dataset):
    findings = _findings(evaluator, ((RADIUS,), 106.0, 1.02), ((LUMP,), 8.0, 1.03), misfit=1.03)
    worse = replace(LADDER, removed=(-0.75, -1.4, -0.31))
    why = rejection_reason(findings, worse)
    findings.withdraw(why)
    report = report_of(dataset, evaluator, findings, LADDER, "test")
    assert report["verdict"] == "none" and report["causes"] == []
    assert report["warnings"] == ["the touches disagree", why]
    assert why.startswith("tool_radius would explain") and "adds 75 % (31 to 140 %)" in why
    chances = {row["effect"]: row["probability"] for row in report["ranking"]}
    assert chances["tool_radius"] == 0.0 < chances["stiff_inclusion"]


def test_ambiguous_report_names_every_rival(evaluator, dataset):
    findings = _findings(
        evaluator, ((LUMP,), 90.0, 1.05), ((RADIUS,), 88.0, 1.1), ((NU,), 20.0, 1.9)
    )
    report = report_of(dataset, evaluator, findings, None, "test")
    assert [cause["effect"] for cause in report["causes"]] == ["stiff_inclusion", "tool_radius"]
    first, second = (cause["probability"] for cause in report["causes"])
    assert 0.5 < first < 0.75 and second == pytest.approx(1 - first, abs=1e-3)


@pytest.mark.parametrize("accepted", [True, False])
def test_probabilities_of_exclusive_causes_add_up_to_at_most_one(evaluator, dataset, accepted):
    trials = (
        ((LUMP,), 20.0, 1.1),
        ((RADIUS,), 16.0, 1.2),
        ((NU,), 13.0, 1.2),
        ((LUMP,), 18.0, 1.2),
    )
    report = report_of(
        dataset, evaluator, _findings(evaluator, *trials, accepted=accepted), None, "test"
    )
    chances = [row["probability"] for row in (*report["causes"], *report["ranking"])]
    assert all(0 <= chance <= 1 for chance in chances)
    assert sum(chances) <= 1 + 1e-3
    assert sum(chances) < 0.99  # that there is no cause has a probability, too


def test_a_further_cause_that_was_refused_is_less_probable_than_not(evaluator, dataset):
    """It gains 10 nats where the search asks 12 of it: the odds against it are what is lacking."""
    findings = _findings(evaluator, ((LUMP,), 90.0, 1.05), ((LUMP, RADIUS), 100.0, 1.02))
    chances = {
        row["effect"]: row["probability"]
        for row in report_of(dataset, evaluator, findings, None, "test")["ranking"]
    }
    assert 0.2 < chances["tool_radius"] < 0.5
    findings.trials[1] = replace(
        findings.trials[1], gain=1000.0, required_gain=np.inf
    )  # of one sequence alone
    report = report_of(dataset, evaluator, findings, None, "test")
    assert {row["effect"]: row["probability"] for row in report["ranking"]}["tool_radius"] == 0.0
    assert report["causes"][0]["probability"] == pytest.approx(1.0, abs=1e-3)


def test_remaining_error_has_place_and_sequence(evaluator, dataset):
    findings = _findings(evaluator, accepted=False, misfit=3.0)
    left = report_of(dataset, evaluator, findings, None, "test")["unexplained"]
    assert left["when"] == "most in poke-02"
    assert 0 <= left["fraction"] <= 1 and "mm" in left["where"]


def test_report_says_how_often_chance_would_name_a_cause(evaluator, dataset):
    findings = _findings(evaluator, misfit=1.0)
    assert "false_alarms" not in report_of(dataset, evaluator, findings, LADDER, "test")["evidence"]
    gains = np.array([*np.linspace(0, 11, 398), 13.0, 14.0])
    findings.chance = ChanceGains(("gravity", "tool_radius"), np.stack([gains, gains / 2], axis=1))
    findings.bounds = {"gravity": 12.0, "tool_radius": 12.0}
    rates = report_of(dataset, evaluator, findings, LADDER, "test")["evidence"]["false_alarms"]
    assert rates["draws"] == 400
    assert rates["named"] == 0.005
    assert 0.01 < rates["named_at_most"] < 0.03
    assert rates["structured"] == pytest.approx(0.001)


REMEMBERS = Viscoelasticity(relaxed_fraction=0.49, time_constant=8.1)
KEEPS = PermanentSet(retained_fraction=0.2)


def _wrong_law(evaluator: Evaluator, left: float) -> Findings:
    """A law that removes 68 % of the misfit above noise, and another of its family 54 %."""
    findings = _findings(
        evaluator, ((REMEMBERS,), 3719.0, 1.32), ((KEEPS,), 2941.0, 1.46), ((RADIUS,), 2900.0, 1.5)
    )
    findings.remaining = Structure(left, 20.0, 30.0, 0.5e-3, 3e-3)
    return findings


def test_laws_of_one_family_stay_possible_where_the_best_one_is_wrong(evaluator, dataset):
    report = report_of(dataset, evaluator, _wrong_law(evaluator, 90.0), LADDER, "test")
    assert report["verdict"] == "ambiguous"
    assert [cause["effect"] for cause in report["causes"]] == ["viscoelasticity", "permanent_set"]
    assert report["family"]["name"] == "memory"
    assert [one["left"] for one in report["family"]["members"]] == [0.32, 0.46]
    assert "release" in report["family"]["parted_by"]
    best, other = (cause["probability"] for cause in report["causes"])
    assert 0.5 < best < 0.9
    assert other > 0.05


def test_one_law_is_named_where_it_leaves_noise(evaluator, dataset):
    report = report_of(dataset, evaluator, _wrong_law(evaluator, 21.0), LADDER, "test")
    assert report["verdict"] == "found"
    assert report["causes"][0]["probability"] == 1.0
    assert "family" not in report


def test_nothing_is_removed_where_the_stated_model_is_at_the_noise(evaluator, dataset):
    findings = _findings(evaluator, ((RADIUS,), 3.0, 0.95), accepted=False, misfit=0.96)
    rows = report_of(dataset, evaluator, findings, LADDER, "test")["ranking"]
    assert {row["error_removed"] for row in rows} == {0.0}


def test_more_than_noise_that_is_too_small_to_matter_is_a_small_remainder(evaluator, dataset):
    findings = _findings(evaluator, accepted=False, misfit=1.4)
    findings.structure = findings.remaining = Structure(18.0, 20.0, 30.0, 0.0, 2e-3)
    assert report_of(dataset, evaluator, findings, LADDER, "test")["verdict"] == "unexplained"
    findings.excess = 0.06e-3
    report = report_of(dataset, evaluator, findings, LADDER, "test")
    assert report["verdict"] == "none"
    assert report["small_remainder"]["rms_mm"] == 0.06
    assert report["small_remainder"]["tolerance_mm"] == 0.1
    findings.excess = 0.2e-3
    assert report_of(dataset, evaluator, findings, LADDER, "test")["verdict"] == "unexplained"
