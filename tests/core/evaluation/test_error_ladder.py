"""The ladder: shares and intervals of known errors, kinds of motion told apart, and what a network
gets no credit for.
"""

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
"""Of the camera: at right angles to what the models are wrong by."""


def _observations() -> Observations:
    """Four pushes of one sequence, after one untouched frame."""
    times, stream = dwelling(np.array([poke(2e-3)] * len(PROBES)))
    groups = [
        Group((number,), CLOUD, probe == 0, probe=probe) for number, probe in enumerate(PROBES)
    ]
    return Observations("push-01", times, stream, tuple(groups))


def _rung(name: str, gap: FloatArray, network: bool = False) -> Rung:
    """A model with these gaps (5, 4) [m], whose single points scatter such that the noise floor is
    FLOOR.
    """
    model: Prediction = prediction(gap, name="push-01", count=POINTS)
    scatter = np.full(gap.shape, FLOOR / np.sqrt(2 / POINTS))
    return Rung(
        name=name,
        label=name,
        setup=SETUP,
        predictions=[replace(model, spread=scatter)],
        network={"kind": "x"} if network else None,
    )


def _sized(*sizes: float) -> FloatArray:
    return np.array([0.0, *sizes])[:, None] * SIGNS


def _climbed(*rungs: Rung, **more: Any) -> dict[str, Any]:
    return build_ladder([_observations()], rungs, KINDS, {"top"}, **more)


def _part(found: dict[str, Any], part: str) -> dict[str, Any]:
    return next(one for one in found["parts"] if one["part"] == part)


THREE = (
    _rung("baseline", _sized(3e-3, 3e-3, 3e-3, 3e-3)),
    _rung("baseline_network", _sized(2e-3, 2e-3, 3e-3, 3e-3), network=True),
    _rung("extended", _sized(1.5e-3, 1.5e-3, 1.5e-3, 1.5e-3)),
)


def test_kinds_that_were_trained_on_are_told_from_those_that_were_not():
    found = _climbed(*THREE)
    seen, unseen = _part(found, "seen"), _part(found, "unseen")
    assert (seen["kinds"], unseen["kinds"]) == (["top"], ["drag"]) and (
        seen["probes"],
        unseen["probes"],
    ) == (2, 2)
    assert seen["errors"]["baseline_network"]["removed"] == {"value": 0.5, "low": 0.5, "high": 0.5}
    assert unseen["errors"]["baseline_network"]["removed"]["value"] == 0.0
    for part in (seen, unseen):
        assert part["errors"]["extended"]["removed"]["value"] == pytest.approx(0.75)
        assert part["noise_floor"] == pytest.approx(1.0)


def test_share_over_all_pushes_has_an_interval_from_drawing_pushes_anew():
    share = _part(_climbed(*THREE), "all")["errors"]["baseline_network"]["removed"]
    wanted = (3 - np.sqrt((4 + 4 + 9 + 9) / 4)) / 2
    assert share["value"] == pytest.approx(wanted, abs=1e-4)
    assert 0.0 == share["low"] < share["value"] < share["high"] == 0.5


def test_difference_to_the_second_rung_is_of_the_same_draws():
    beyond = _part(_climbed(*THREE), "unseen")["beyond_second"]["extended"]["removed"]
    assert beyond == pytest.approx({"value": 0.75, "low": 0.75, "high": 0.75})


def test_cameras_pattern_that_a_network_learned_counts_for_nothing():
    touched = _sized(3e-3, 3e-3, 3e-3, 3e-3)
    still = 2e-3 * PATTERN
    learned = _rung(
        "baseline_network", touched, network=True
    )  # the pattern is gone everywhere, and nothing else
    found = _climbed(
        _rung("baseline", touched + still),
        learned,
        _rung("extended", touched / 2 + still),
        ends=(0, 2),
    )
    errors = _part(found, "all")["errors"]
    assert errors["baseline"]["error"] == errors["baseline_network"]["error"] == 3.0


def test_sag_that_a_model_names_counts_and_also_when_a_network_learned_it():
    touched, sag = _sized(1e-3, 1e-3, 1e-3, 1e-3), 3e-3 * np.ones(4)
    learned = _rung("baseline_network", touched + sag / 3, network=True)
    found = _climbed(
        _rung("baseline", touched + sag), learned, _rung("extended", touched), ends=(0, 2)
    )
    errors = _part(found, "all")["errors"]
    assert errors["baseline"]["error"] == pytest.approx(1e3 * np.hypot(1e-3, 3e-3), abs=1e-4)
    assert errors["baseline_network"]["error"] == pytest.approx(
        1e3 * np.hypot(1e-3, 1e-3), abs=1e-4
    )
    assert errors["extended"]["error"] == pytest.approx(1.0, abs=1e-4)
    assert {errors[name]["moving"]["error"] for name in errors} == {1.0}


def test_sentence_says_both_shares_on_both_kinds():
    assert summary_sentence(_climbed(*THREE)) == (
        "The network alone removes 50 % and 0 % of the error that can be removed on kinds of motion that training has, and on "
        "others; naming the cause alone 75 % and 75 %."
    )


def test_sentence_of_a_lone_model_asks_for_another():
    assert "nothing stands beside it yet" in summary_sentence(_climbed(THREE[0]))


def test_sentence_of_a_network_alone_says_what_cannot_be_told_without_a_second_model():
    text = summary_sentence(_climbed(*THREE[:2], ends=(0, 0)))
    assert (
        "50 % and 0 % of the error that moves with the tool" in text
        and "may be the camera's" in text
    )


def test_block_that_stays_where_it_slid_is_no_pattern_of_the_cameras():
    item = _observations()
    after = (
        False,
        False,
        True,
        False,
        True,
    )  # the second and the fourth look are at a block that was left
    rows = zip(item.groups, after, (0, 1, 1, 2, 2), strict=True)
    groups = tuple(
        replace(group, free=free or not probe, probe=probe) for group, free, probe in rows
    )
    slid, corrected = _sized(3e-3, 3e-3, 3e-3, 3e-3), _sized(1e-3, 3e-3, 1e-3, 3e-3)
    rungs = [
        _rung("baseline", slid),
        _rung("baseline_network", corrected, network=True),
        _rung("true", _sized(0, 0, 0, 0)),
    ]
    found = _part(build_ladder([replace(item, groups=groups)], rungs, KINDS, {"top"}), "all")[
        "errors"
    ]
    assert found["baseline"]["error"] == pytest.approx(3.0)
    # It is right while the tool is there to tell it, and pays for what it leaves, not for what it
    # mends.
    assert found["baseline_network"]["error"] == pytest.approx(np.sqrt((1 + 9) / 2), abs=1e-3)
    assert found["baseline_network"]["removed"]["value"] == pytest.approx(
        (3 - np.sqrt(5)) / 2, abs=1e-3
    )
