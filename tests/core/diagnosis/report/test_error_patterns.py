"""Patterns of the measured error and of the error that a model predicts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from evaluating import evaluator_of
from matplotlib.image import imread
from pushed_block import SETUP, dwelling, poke, prediction, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.diagnosis.report.error_patterns import draw_patterns, error_patterns
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield evaluator_of(
            SETUP, registration(), workers, ["poke-01"], None, GridSpec(), GridSpec()
        )


def _pictured(evaluator: Evaluator, gap: FloatArray, count: FloatArray) -> Model:
    return Model((), SETUP, (prediction(gap, count=count),), (), ModelColumns(()))


def _watched(probes: list[int | None], frames: int = 1) -> list[Observations]:
    """The rest cloud, then groups of these pushes; None stands for an untouched one."""
    times, stream = dwelling(np.array([poke(2e-3)] * len(probes)))
    cloud = np.zeros((frames, 3))
    groups = [
        Group((number,), cloud, probe is None, reference=number == 0, push=probe or 0)
        for number, probe in enumerate(probes)
    ]
    return [Observations("poke-01", times, stream, tuple(groups))]


def test_patterns_are_of_the_push_that_the_cause_changes_most(evaluator, tmp_path):
    random = np.random.default_rng(1)
    patches = evaluator.problem.surface.patches
    camera = 1e-4 * random.standard_normal(patches)
    size = np.array([0.0, 0.0, 1.0, 2.0])[:, None]
    gap, count = camera + size * 3e-4, np.full((4, patches), 10.0)
    after = gap - size * 2e-4
    data = _watched([None, None, 0, 1])
    found = error_patterns(
        evaluator, data, _pictured(evaluator, gap, count), _pictured(evaluator, after, count)
    )
    # A uniform error stays what it is when smoothed; the camera's pattern is taken off.
    assert np.allclose(found.measured, 6e-4)
    assert np.allclose(found.predicted, 4e-4)
    found.save(tmp_path / "patterns.npz")
    with np.load(tmp_path / "patterns.npz") as saved:
        assert set(saved) == {"centres", "normals", "measured", "predicted"}
        assert saved["centres"].shape == saved["normals"].shape == (patches, 3)


def test_patches_without_points_are_not_a_number(evaluator):
    gap = np.full((3, evaluator.problem.surface.patches), 1e-4)
    gap[0:2] = 0.0
    gap[:, 4] = np.nan
    count = np.full(gap.shape, 10.0)
    found = error_patterns(
        evaluator,
        _watched([None, None, 0]),
        _pictured(evaluator, gap, count),
        _pictured(evaluator, 0 * gap, count),
    )
    assert np.isnan(found.measured[4]) and np.isfinite(np.delete(found.measured, 4)).all()


def test_patterns_are_drawn_as_png(evaluator, tmp_path: Path):
    gap = 1e-3 * np.random.default_rng(2).standard_normal((4, evaluator.problem.surface.patches))
    count = np.full(gap.shape, 10.0)
    found = error_patterns(
        evaluator,
        _watched([None, None, 0, 0]),
        _pictured(evaluator, gap, count),
        _pictured(evaluator, 0.2 * gap, count),
    )
    draw_patterns(found, tmp_path / "patterns.png")
    assert (tmp_path / "patterns.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "patterns.png").stat().st_size > 10_000


def test_without_a_cause_the_largest_error_is_drawn_alone(evaluator, tmp_path):
    size = np.array([0.0, 0.0, 1.0, 2.0])[:, None]
    gap, count = (
        size * np.full((1, evaluator.problem.surface.patches), 3e-4),
        np.full((4, evaluator.problem.surface.patches), 10.0),
    )
    model = _pictured(evaluator, gap, count)
    unnamed = error_patterns(evaluator, _watched([None, None, 0, 1]), model, model)
    assert np.allclose(unnamed.measured, 6e-4) and not unnamed.predicted.any()
    named = error_patterns(
        evaluator, _watched([None, None, 0, 1]), model, _pictured(evaluator, 0.2 * gap, count)
    )
    widths = []
    for number, one in enumerate((unnamed, named)):
        draw_patterns(one, tmp_path / f"{number}.png")
        widths.append(imread(tmp_path / f"{number}.png").shape[1])
    assert widths[0] < 0.65 * widths[1]
