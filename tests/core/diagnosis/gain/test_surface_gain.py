from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import POSE, SETUP, dwelling, poke, prediction, seen_points

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.gain.probe_errors import fixed_pattern
from palpate.diagnosis.gain.surface_gain import SurfaceGain, surface_gain
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.effects.support import BaseSlip
from palpate.effects.time_dependence import PermanentSet
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError
from palpate.measurement.metrics import paper_distance
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import rest

PATCHES, POINTS = 5, 10.0
CLOUD = seen_points(rest(SETUP, GridSpec()), 300, 3e-4, 0)
FLOOR = 1e-3


def _observations(probes: list[int], name: str = "poke-01") -> Observations:
    """Groups of these pushes; 0 stands for an untouched group."""
    times, stream = dwelling(np.array([poke(2e-3)] * len(probes)))
    groups = [
        Group((number,), CLOUD, probe == 0, push=probe) for number, probe in enumerate(probes)
    ]
    return Observations(name, times, stream, tuple(groups))


def _model(
    sizes: list[float], name: str = "poke-01", points: float = POINTS, failed: tuple[int, ...] = ()
) -> Prediction:
    """Gaps of these sizes [m] in each group, of either sign."""
    signs = np.array([1.0, -1.0, 1.0, -1.0, np.nan])
    return prediction(np.array(sizes)[:, None] * signs, name=name, count=points, failed=failed)


def _ladder(
    probes: list[int], before: list[float], after: list[float], failed: tuple[int, ...] = ()
) -> SurfaceGain:
    """The gain by these errors; the scatter of single points makes the noise floor FLOOR."""
    known = POINTS * sum(probe == 0 for probe in probes)
    scatter = np.full((len(probes), PATCHES), FLOOR / np.sqrt(1 / POINTS + 1 / known))
    still = [0.0 if probe == 0 else 1.0 for probe in probes]
    models = [
        replace(_model(list(np.array(sizes) * still), failed=which), spread=scatter)
        for sizes, which in ((before, ()), (after, failed))
    ]
    return surface_gain([_observations(probes)], models[:1], models[1:], SETUP, SETUP, seed=0)


def test_share_of_the_reducible_error_is_known():
    found = _ladder([0, 1, 2, 0], [5e-3, 3e-3, 3e-3, 5e-3], [FLOOR, 1.5e-3, 1.5e-3, FLOOR])
    assert found.baseline == pytest.approx(3e-3) and found.extended == pytest.approx(1.5e-3)
    assert found.noise_floor == pytest.approx(FLOOR)
    assert found.removed == pytest.approx((0.75, 0.75, 0.75))
    assert found.probes == 2


def test_fixed_pattern_of_the_camera_is_no_error():
    item = _observations([0, 1])
    pattern = _model([2e-3, 2e-3])
    found = surface_gain([item], [pattern], [pattern], SETUP, SETUP, seed=0)
    assert found.baseline == pytest.approx(0.0, abs=1e-12)


def test_pattern_that_only_one_model_has_is_its_error():
    item, touched = _observations([0, 1]), [0.0, 3e-3]
    still = replace(_model([2e-3, 0.0]), gap=_model([2e-3, 2e-3]).gap + _model(touched).gap)
    found = surface_gain([item], [still], [_model([0.0, 3e-3])], SETUP, SETUP, seed=0)
    assert found.baseline == pytest.approx(np.hypot(3e-3, 2e-3))
    assert found.extended == pytest.approx(3e-3)
    assert found.added < 0
    back = surface_gain([item], [_model([0.0, 3e-3])], [still], SETUP, SETUP, seed=0)
    assert back.added == pytest.approx(np.hypot(3e-3, 2e-3) - 3e-3)
    assert (back.baseline, back.extended) == pytest.approx((found.extended, found.baseline))


def test_pattern_as_large_in_both_models_gains_nothing():
    item = _observations([0, 1])
    models = [_model([size, size]) for size in (2e-3, -2e-3)]
    found = surface_gain([item], models[:1], models[1:], SETUP, SETUP, seed=0)
    assert found.baseline == pytest.approx(2e-3) and found.extended == pytest.approx(2e-3)
    assert found.removed == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_unnamed_part_of_a_sag_counts_as_error():
    item = _observations([0, 1])
    stated, named = _model([3e-3, 3e-3]), _model([1e-3, 1e-3])  # two thirds of it
    found = surface_gain([item], [stated], [named], SETUP, SETUP, seed=0)
    assert found.baseline == pytest.approx(3e-3) and found.extended == pytest.approx(1e-3)
    assert found.removed[0] == pytest.approx(2 / 3)


def test_scatter_of_single_points_makes_the_noise_floor():
    item, spread = _observations([0, 1]), 2e-3
    before = replace(_model([0.0, 1e-3]), spread=np.full((2, PATCHES), spread))
    found = surface_gain([item], [before], [before], SETUP, SETUP, seed=0)
    assert found.baseline == pytest.approx(1e-3)
    assert found.noise_floor == pytest.approx(spread * np.sqrt(2 / POINTS))


def test_groups_are_weighed_by_their_points():
    item, counts = _observations([0, 1, 2]), np.array([[10.0], [30.0], [10.0]]) * np.ones(PATCHES)
    before, after = (
        replace(_model(sizes), count=counts) for sizes in ([0.0, 1e-3, 3e-3], [0.0, 1e-3, 1e-3])
    )
    found = surface_gain([item], [before], [after], SETUP, SETUP, seed=0)
    assert found.baseline == pytest.approx(np.sqrt((30 * 1e-6 + 10 * 9e-6) / 40))


def _many(seed: int, probes: int) -> SurfaceGain:
    """Pushes with random errors; half of the reducible error is removed on average."""
    before, after = _varied(seed, probes)
    return _ladder([0, *range(1, probes + 1)], [FLOOR, *before], [FLOOR, *after])


def _varied(seed: int, probes: int) -> tuple[FloatArray, FloatArray]:
    random = np.random.default_rng(seed)
    before = random.uniform(2e-3, 4e-3, probes)
    return before, random.uniform(0.3, 0.9, probes) * before


def test_interval_holds_the_share_of_infinite_data():
    before, after = _varied(0, 200000)
    wanted = (np.sqrt(np.mean(before**2)) - np.sqrt(np.mean(after**2))) / (
        np.sqrt(np.mean(before**2)) - FLOOR
    )
    found = [_many(seed, 24).removed for seed in range(1, 41)]
    inside = np.mean([low <= wanted <= high for _, low, high in found])
    assert inside >= 0.85
    assert all(low < value < high for value, low, high in found)


def test_more_pushes_make_the_interval_narrower():
    (_, low, high), (_, low_4, high_4) = _many(1, 10).removed, _many(1, 90).removed
    assert high_4 - low_4 < 0.6 * (high - low)


def test_pushes_are_resampled_whole():
    before, after = _varied(3, 8)
    whole = _ladder([0, *range(1, 9)], [FLOOR, *before], [FLOOR, *after])
    # Six groups of each push instead of one add no information.
    probes = [0, *np.repeat(np.arange(1, 9), 6)]
    parts = _ladder(probes, [FLOOR, *np.repeat(before, 6)], [FLOOR, *np.repeat(after, 6)])
    assert parts.probes == whole.probes == 8
    assert parts.removed == pytest.approx(whole.removed)


def test_pushes_of_different_sequences_are_different():
    items = [_observations([0, 1], name) for name in ("a", "b")]
    models = [_model([FLOOR, size], name) for name, size in (("a", 3e-3), ("b", 4e-3))]
    assert surface_gain(items, models, models, SETUP, SETUP, seed=0).probes == 2


def test_nothing_is_removed_where_nothing_is_reducible():
    found = _ladder([0, 1, 2], [FLOOR] * 3, [FLOOR, 0.9 * FLOOR, 0.9 * FLOOR])
    assert found.removed == (0.0, 0.0, 0.0)


def test_model_that_is_worse_removes_less_than_nothing():
    found = _ladder([0, 1, 2], [FLOOR, 2e-3, 2e-3], [FLOOR, 3e-3, 3e-3])
    assert found.removed[0] == pytest.approx(-1.0)


def test_group_that_one_model_fails_in_counts_for_neither():
    found = _ladder([0, 1, 2], [FLOOR, 2e-3, 9e-3], [FLOOR, 1e-3, 9e-3], failed=(2,))
    assert found.baseline == pytest.approx(2e-3) and found.extended == pytest.approx(1e-3)
    assert found.probes == 1


def test_sequence_without_untouched_frames_is_refused():
    item, model = _observations([1, 2]), _model([1e-3, 1e-3])
    with pytest.raises(DiagnosisError, match="no untouched frame"):
        surface_gain([item], [model], [model], SETUP, SETUP, seed=0)


def test_sequences_without_any_touch_are_refused():
    item, model = _observations([0, 0]), _model([1e-3, 1e-3])
    with pytest.raises(DiagnosisError, match="no frame in which the tool touches"):
        surface_gain([item], [model], [model], SETUP, SETUP, seed=0)


def test_papers_metric_is_the_mean_over_touched_groups():
    found = _ladder([0, 1, 2], [FLOOR, 2e-3, 3e-3], [FLOOR, 2e-3, 3e-3])
    wanted = paper_distance(POSE.apply(CLOUD), rest(SETUP, GridSpec()), SETUP.surface())
    assert found.paper == pytest.approx((wanted, wanted))


@pytest.mark.parametrize(
    "effect", [PermanentSet(retained_fraction=0.2), BaseSlip(friction_coefficient=0.1)]
)
def test_groups_after_a_push_count_if_the_material_has_history_or_the_base_slides(effect):
    item = _observations([0, 1, 1, 2])
    item = replace(
        item, groups=tuple(replace(g, free=n in (0, 2)) for n, g in enumerate(item.groups))
    )
    stated, named = _model([0.0, 1e-3, 4e-3, 1e-3]), _model([0.0, 1e-3, 1e-3, 1e-3])
    kept = effect.apply(SETUP)
    found = surface_gain([item], [stated], [named], SETUP, kept, seed=0)
    assert found.baseline == pytest.approx(np.sqrt((1 + 16 + 1) / 3) * 1e-3)
    assert found.extended == pytest.approx(1e-3) and found.probes == 2
    # The dent is no pattern of the camera's, and without a memory no push is asked for it.
    assert fixed_pattern(item, stated, True)[0] == pytest.approx(0.0)
    assert np.abs(fixed_pattern(item, stated)[0]).max() > 1e-3
