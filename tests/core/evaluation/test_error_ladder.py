"""Error ladders of known errors: shares, intervals, kinds of motion, and the camera's pattern."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pushed_block import SETUP, dwelling, poke, prediction, seen_points

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.evaluation.error_ladder import Rung, build_ladder
from palpate.evaluation.summary_sentence import summary_sentence
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import rest

CLOUD = seen_points(rest(SETUP, GridSpec()), 300, 3e-4, 0)
POINTS, FLOOR = 10.0, 1e-3
PROBES = [0, 1, 2, 3, 4]
KINDS = {"push-01/1": "top", "push-01/2": "top", "push-01/3": "drag", "push-01/4": "drag"}
SIGNS = np.array([1.0, -1.0, 1.0, -1.0])
PATTERN = np.array([1.0, 1.0, -1.0, -1.0])
"""Fixed pattern of the camera, orthogonal to the models' errors."""


def _observations() -> Observations:
    """Four pushes of one sequence, after one untouched frame."""
    times, stream = dwelling(np.array([poke(2e-3)] * len(PROBES)))
    groups = [
        Group((number,), CLOUD, probe == 0, push=probe) for number, probe in enumerate(PROBES)
    ]
    return Observations("push-01", times, stream, tuple(groups))


def _rung(name: str, gap: FloatArray, network: bool = False) -> Rung:
    """Return a model with gaps (5, 4) [m] and points whose scatter gives the noise floor FLOOR."""
    model: Prediction = prediction(gap, name="push-01", count=POINTS)
    scatter = np.full(gap.shape, FLOOR / np.sqrt(2 / POINTS))
    return Rung(
        name=name,
        label=name,
        setup=SETUP,
        predictions=[replace(model, spread=scatter)],
        network={"kind": "x"} if network else None,
    )


def _gaps(*sizes: float) -> FloatArray:
    return np.array([0.0, *sizes])[:, None] * SIGNS


def _ladder(*rungs: Rung, **more: Any) -> dict[str, Any]:
    return build_ladder([_observations()], rungs, KINDS, {"top"}, **more)


def _part(result: dict[str, Any], part: str) -> dict[str, Any]:
    return next(one for one in result["parts"] if one["part"] == part)


THREE = (
    _rung("baseline", _gaps(3e-3, 3e-3, 3e-3, 3e-3)),
    _rung("baseline_network", _gaps(2e-3, 2e-3, 3e-3, 3e-3), network=True),
    _rung("extended", _gaps(1.5e-3, 1.5e-3, 1.5e-3, 1.5e-3)),
)


def test_trained_and_untrained_kinds_of_motion_are_reported_apart():
    result = _ladder(*THREE)
    seen, unseen = _part(result, "seen"), _part(result, "unseen")
    assert (seen["kinds"], unseen["kinds"]) == (["top"], ["drag"]) and (
        seen["probes"],
        unseen["probes"],
    ) == (2, 2)
    assert seen["errors"]["baseline_network"]["removed"] == {"value": 0.5, "low": 0.5, "high": 0.5}
    assert unseen["errors"]["baseline_network"]["removed"]["value"] == 0.0
    for part in (seen, unseen):
        assert part["errors"]["extended"]["removed"]["value"] == pytest.approx(0.75)
        assert part["noise_floor"] == pytest.approx(1.0)


def test_share_over_all_pushes_has_a_bootstrap_interval():
    share = _part(_ladder(*THREE), "all")["errors"]["baseline_network"]["removed"]
    expected = (3 - np.sqrt((4 + 4 + 9 + 9) / 4)) / 2
    assert share["value"] == pytest.approx(expected, abs=1e-4)
    assert 0.0 == share["low"] < share["value"] < share["high"] == 0.5


def test_difference_to_the_second_rung_uses_the_same_bootstrap_samples():
    beyond = _part(_ladder(*THREE), "unseen")["beyond_second"]["extended"]["removed"]
    assert beyond == pytest.approx({"value": 0.75, "low": 0.75, "high": 0.75})


def test_learned_pattern_of_the_camera_gets_no_credit():
    touched = _gaps(3e-3, 3e-3, 3e-3, 3e-3)
    still = 2e-3 * PATTERN
    # The network removes the pattern everywhere, and nothing else.
    learned = _rung("baseline_network", touched, network=True)
    result = _ladder(
        _rung("baseline", touched + still),
        learned,
        _rung("extended", touched / 2 + still),
        ends=(0, 2),
    )
    errors = _part(result, "all")["errors"]
    assert errors["baseline"]["error"] == errors["baseline_network"]["error"] == 3.0


def test_sag_that_a_model_explains_counts_for_models_and_networks():
    touched, sag = _gaps(1e-3, 1e-3, 1e-3, 1e-3), 3e-3 * np.ones(4)
    learned = _rung("baseline_network", touched + sag / 3, network=True)
    result = _ladder(
        _rung("baseline", touched + sag), learned, _rung("extended", touched), ends=(0, 2)
    )
    errors = _part(result, "all")["errors"]
    assert errors["baseline"]["error"] == pytest.approx(1e3 * np.hypot(1e-3, 3e-3), abs=1e-4)
    assert errors["baseline_network"]["error"] == pytest.approx(
        1e3 * np.hypot(1e-3, 1e-3), abs=1e-4
    )
    assert errors["extended"]["error"] == pytest.approx(1.0, abs=1e-4)
    assert {errors[name]["moving"]["error"] for name in errors} == {1.0}


def test_sentence_has_both_shares_on_both_kinds():
    assert summary_sentence(_ladder(*THREE)) == (
        "The network alone removes 50 % and 0 % of the error that can be removed on kinds of "
        "motion that training has, and on others; naming the cause alone 75 % and 75 %."
    )


def test_sentence_of_a_network_that_makes_it_worse_says_so_in_mm() -> None:
    worse = _rung("baseline_network", _gaps(3e-3, 3e-3, 3e-3, 3e-3), network=True)
    better = _rung("extended", _gaps(1e-3, 1e-3, 1e-3, 1e-3))
    before = _rung("baseline", _gaps(2e-3, 2e-3, 2e-3, 2e-3))
    text = summary_sentence(_ladder(before, worse, better))
    assert text.startswith(
        "The network alone makes it worse (2.00 to 3.00 mm and 2.00 to 3.00 mm) on kinds of motion"
    )
    assert "naming the cause alone removes" in text


def test_sentence_of_a_single_model_says_that_there_is_no_other():
    assert "no other model to compare yet" in summary_sentence(_ladder(THREE[0]))


def test_sentence_of_a_network_alone_says_that_a_second_model_is_needed():
    text = summary_sentence(_ladder(*THREE[:2], ends=(0, 0)))
    assert (
        "50 % and 0 % of the error that moves with the tool" in text
        and "may be the camera's" in text
    )


def test_displaced_block_is_not_taken_for_the_cameras_pattern():
    item = _observations()
    # The second and the fourth look are at a displaced block after a push.
    after = (False, False, True, False, True)
    rows = zip(item.groups, after, (0, 1, 1, 2, 2), strict=True)
    groups = tuple(
        replace(group, free=free or not probe, push=probe) for group, free, probe in rows
    )
    slid, corrected = _gaps(3e-3, 3e-3, 3e-3, 3e-3), _gaps(1e-3, 3e-3, 1e-3, 3e-3)
    rungs = [
        _rung("baseline", slid),
        _rung("baseline_network", corrected, network=True),
        _rung("true", _gaps(0, 0, 0, 0)),
    ]
    result = _part(build_ladder([replace(item, groups=groups)], rungs, KINDS, {"top"}), "all")[
        "errors"
    ]
    assert result["baseline"]["error"] == pytest.approx(3.0)
    # The network is right while the tool touches, and is charged for the error that it leaves.
    assert result["baseline_network"]["error"] == pytest.approx(np.sqrt((1 + 9) / 2), abs=1e-3)
    assert result["baseline_network"]["removed"]["value"] == pytest.approx(
        (3 - np.sqrt(5)) / 2, abs=1e-3
    )
