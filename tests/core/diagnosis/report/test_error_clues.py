"""Clues to an error that no cause explains, on errors that are put into a prediction by hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from noisy_model import stated_evaluator
from pushed_block import GRID, SETUP, dwelling, poke, prediction

from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.diagnosis.report.error_clues import (
    BEFORE,
    CONTACT,
    PHANTOM,
    RELEASED,
    TOOL,
    WHOLE,
    error_clues,
)
from palpate.diagnosis.search.findings import Findings
from palpate.foundation.arrays import FloatArray
from palpate.registration.pose import motion_jacobian
from palpate.replay.replay import Equilibrium, replay

SIGMA = 5e-5
PLACES = [(4e-3, -2e-3), (-12e-3, 6e-3), (15e-3, 8e-3)]
CLEAR = np.array([0.0, 0.0, 0.1])
CENTRES = np.array(
    [CLEAR, CLEAR, *(c for x, y in PLACES for c in (poke(1.5e-3, x, y), poke(4e-3, x, y), CLEAR))]
)
PUSH = [0, 0, *(n for n in (1, 2, 3) for _ in range(3))]


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with stated_evaluator() as found:
        yield found


@pytest.fixture(scope="module")
def frames() -> tuple[Equilibrium, ...]:
    return tuple(replay(SETUP, CENTRES, GRID))


def clues(
    evaluator: Evaluator,
    frames: tuple[Equilibrium, ...],
    error: FloatArray,
    verdict: str = "unexplained",
):
    """The clues to an error (g, p) [m] with noise of SIGMA and a fixed pattern of the camera."""
    rng = np.random.default_rng(3)
    patches = evaluator.problem.surface.patches
    pattern = 3e-4 * rng.normal(size=patches)
    gap = pattern + error + SIGMA * rng.normal(size=(len(CENTRES), patches))
    own = replace(prediction(gap), equilibria=frames)
    model = Model((), SETUP, (own,), (), ModelColumns(()))
    weights = np.full(gap.shape, SIGMA**-2)
    evaluator.state.noises = [Noise(weights, gap, 0 * gap, np.zeros((*gap.shape, 0)))]
    times, stream = dwelling(CENTRES)
    groups = tuple(
        Group((number,), np.zeros((1, 3)), not frame.in_contact, push=push)
        for number, (frame, push) in enumerate(zip(frames, PUSH, strict=True))
    )
    data = [Observations("poke-01", times, stream, groups)]
    return error_clues(evaluator, data, Findings(model), verdict)


def depth(frames: tuple[Equilibrium, ...]) -> FloatArray:
    """Size (g, 1) of each group's deformation over the largest [1]."""
    size = np.array([np.linalg.norm(one.displacement, axis=1).max() for one in frames])
    size *= [one.in_contact for one in frames]
    return size[:, None] / size.max()


def test_noise_alone_leaves_no_clue(evaluator, frames):
    found = clues(evaluator, frames, np.zeros((len(CENTRES), 1)))
    assert max(found["rms_mm_when"].values()) < 0.4e3 * SIGMA
    assert max(found["moves_with"].values()) < 0.3


def test_error_of_the_whole_view_is_told(evaluator, frames):
    surface = evaluator.problem.surface
    rigid = np.einsum(
        "pi,pij->pj", surface.patch_normals, motion_jacobian(surface.patch_centres, np.zeros(3))
    )
    size = [2e-4, 2e-4, 2e-4, 4e-3, 4e-3, 4e-3]
    moved = np.random.default_rng(5).normal(size=(len(CENTRES), 6)) * size
    moved *= depth(frames) > 0
    found = clues(evaluator, frames, moved @ rigid.T)
    assert found["moves_with"][WHOLE] > 0.95
    assert found["moves_with"][PHANTOM] < 0.6
    assert "camera" in found["measure_next"]


def test_error_that_follows_the_tool_is_told(evaluator, frames):
    away = np.linalg.norm(evaluator.problem.surface.patch_centres[None] - CENTRES[:, None], axis=2)
    found = clues(evaluator, frames, 5e-4 * depth(frames) * np.exp(-0.5 * (away / 8e-3) ** 2))
    assert found["moves_with"][TOOL] > 0.8
    assert found["moves_with"][TOOL] > found["moves_with"][PHANTOM] + 0.2
    assert found["grows_with_push"] > 1.5
    assert found["rms_mm_when"][CONTACT] > 5 * found["rms_mm_when"][RELEASED]
    assert "ball" in found["measure_next"]


def test_error_at_a_place_of_the_phantom_is_told(evaluator, frames):
    centres = evaluator.problem.surface.patch_centres
    spot = np.exp(-0.5 * (np.linalg.norm(centres - [-0.02, 0.0, 0.036], axis=1) / 6e-3) ** 2)
    found = clues(evaluator, frames, 5e-4 * depth(frames) * spot)
    assert found["moves_with"][PHANTOM] > 0.9
    assert found["moves_with"][PHANTOM] > found["moves_with"][TOOL] + 0.1
    assert "push again at this place" in found["measure_next"]


def test_error_that_stays_after_a_release_is_told(evaluator, frames):
    after = np.array([push > 0 for push in PUSH])[:, None]
    centres = evaluator.problem.surface.patch_centres
    spot = np.exp(-0.5 * (np.linalg.norm(centres - [0.0, 0.0, 0.036], axis=1) / 8e-3) ** 2)
    found = clues(evaluator, frames, 5e-4 * after * spot)
    assert found["rms_mm_when"][RELEASED] > 0.3 * found["rms_mm_when"][CONTACT]
    assert found["rms_mm_when"][BEFORE] < 0.1 * found["rms_mm_when"][CONTACT]
    assert "after each push" in found["measure_next"]


def test_error_before_anything_is_touched_is_the_cameras(evaluator, frames):
    flicker = np.asarray(5e-4 * (-1.0) ** np.arange(len(CENTRES))[:, None])
    found = clues(evaluator, frames, flicker * np.ones(evaluator.problem.surface.patches))
    assert "camera" in found["measure_next"]
    assert "before anything is touched" in found["measure_next"]


def test_worst_frames_are_those_with_the_error(evaluator, frames):
    error = np.zeros((len(CENTRES), evaluator.problem.surface.patches))
    error[6] = 4e-4
    found = clues(evaluator, frames, error)
    worst = found["worst_frames"][0]
    assert worst["sequence"] == "poke-01"
    assert worst["time_s"] == pytest.approx(dwelling(CENTRES)[0][6], abs=1e-3)
    assert worst["rms_mm"] == pytest.approx(0.4, rel=0.2)


def test_other_verdicts_need_no_clues(evaluator, frames):
    assert clues(evaluator, frames, np.zeros((len(CENTRES), 1)), "none") is None
