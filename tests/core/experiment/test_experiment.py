"""An experiment relates the frames once, replays its model, and observes what the camera saw."""

from __future__ import annotations

import numpy as np
import pytest
from large_tool import RADIUS, large_tool_dataset

import palpate as pp
from palpate.experiment import Experiment
from palpate.foundation.errors import DatasetError, EffectError
from palpate.recording.compare_replay import ReplayComparison
from palpate.synthetic.solver.obstacles import shaft_radius

SEQUENCE = "poke-top-01"


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return pp.register(large_tool_dataset(tmp_path_factory.mktemp("experiment") / "large-tool"))


def _share_of_noise(compared: ReplayComparison) -> float:
    """RMS error of the frames in contact over that of the frames without [1]."""
    touched = np.array([frame.in_contact for frame in compared.replay.frames])
    rms = compared.frame_rms
    return float(np.sqrt(np.mean(rms[touched] ** 2) / np.mean(rms[~touched] ** 2)))


def test_right_radius_leaves_noise_alone_in_frames_with_contact(experiment: Experiment) -> None:
    stated = pp.compare(experiment.replay(SEQUENCE, every=2))
    right = pp.compare(
        experiment.with_effects(pp.effects.ToolRadius(radius=RADIUS)).replay(SEQUENCE, every=2)
    )
    assert _share_of_noise(stated) > 1.15
    assert _share_of_noise(right) < 1.05
    assert right.rms < stated.rms
    assert len(stated.replay.failed) == len(right.replay.failed) == 0


def test_points_on_the_tool_of_the_model_are_not_the_phantoms(experiment: Experiment) -> None:
    right = experiment.with_effects(pp.effects.ToolRadius(radius=RADIUS))
    clouds = experiment.observe(SEQUENCE).clouds
    fewer = right.observe(SEQUENCE).clouds
    also = experiment.observe(SEQUENCE, radii=[RADIUS]).clouds
    assert sum(map(len, fewer)) < sum(map(len, clouds))
    assert all(np.array_equal(one, other) for one, other in zip(fewer, also, strict=True))


def test_shaft_is_found_with_its_radius(experiment: Experiment) -> None:
    assert experiment.shaft is not None
    assert experiment.shaft.radius == pytest.approx(shaft_radius(RADIUS), abs=0.2e-3)


def test_replay_has_a_force_and_an_outcome_for_each_chosen_frame(experiment: Experiment) -> None:
    replay = experiment.replay(SEQUENCE, every=10)
    stamps = np.asarray(experiment.dataset.sequence(SEQUENCE).cloud_times)[::10]
    assert replay.force.shape == (len(stamps), 3)
    assert np.array_equal(replay.times, stamps)


def test_effects_are_added_to_those_before_and_leave_the_stated_setup(
    experiment: Experiment,
) -> None:
    both = experiment.with_effects(pp.effects.ToolRadius(radius=RADIUS)).with_effects(
        pp.effects.PoissonRatio(nu=0.4)
    )
    assert [effect.name for effect in both.effects] == ["tool_radius", "poisson_ratio"]
    assert (both.setup.tool.radius, both.setup.material.poisson_ratio) == (RADIUS, 0.4)
    assert both.stated.tool.radius == experiment.setup.tool.radius == 5e-3


def test_effect_that_does_not_fit_and_sequence_that_is_not_there_are_told(
    experiment: Experiment,
) -> None:
    with pytest.raises(EffectError, match="radius"):
        experiment.with_effects(pp.effects.ToolRadius(radius=-1.0))
    with pytest.raises(DatasetError, match="poke-top-09"):
        experiment.replay("poke-top-09")
