from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import (
    CORNERS,
    GRID,
    POSE,
    SETUP,
    SIZE,
    TOP,
    dwelling,
    observed,
    poke,
    seen_points,
)

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward import jacobian as columns_module
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS, JacobianRequest
from palpate.diagnosis.forward.prediction import Prediction, predict
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.geometry import GeometryScale
from palpate.effects.sensor import CameraRegistration, DepthBias
from palpate.effects.tool import LandmarkMismatch
from palpate.foundation.arrays import FloatArray
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.box_mesh import GridSpec
from palpate.registration.pose import small_motion
from palpate.replay.replay import rest
from palpate.setup.setup import Inclusion, Load, Setup, Tool

PIVOT = np.array([0.0, 0.0, TOP])
CENTRES = np.array([poke(-8e-3), poke(2e-3), poke(4e-3)])
TRUTH = replace(SETUP, tool=Tool(radius=5.3e-3, offset=(2e-4, 0.0, 1e-4)))
LUMP = Inclusion(x=5e-3, y=0.0, z=0.024, radius=7e-3, stiffness_ratio=5.0)
RADIUS_STEP, CAMERA_STEP, MOVE = 3e-7, 1e-6, 1e-5
TIGHT = 1e-8
GROWING = GridSpec(nodes=(13, 9, 7))
"""An even grid: its elements grow with the block."""


def _wider(step: float) -> Setup:
    return replace(SETUP, tool=Tool(radius=SETUP.tool.radius + step))


def _camera_lifted(step: float) -> Setup:
    return replace(CameraRegistration.neutral(SETUP), tz=step).apply(SETUP)


(RATIO,) = (item for item in StiffInclusion.parameters() if item.name == "stiffness_ratio")
WANTED = JacobianRequest(
    setups=(_wider(RADIUS_STEP), _camera_lifted(CAMERA_STEP)),
    steps=(RADIUS_STEP, CAMERA_STEP),
    lumps=(LUMP,),
    pivot=PIVOT,
)

# Column, the setup changed by a finite step, and the step.
CHANGES: dict[str, tuple[int, Setup, float]] = {
    **{
        f"tool along {'xyz'[axis]}": (
            axis,
            replace(SETUP, tool=Tool(radius=5e-3, offset=tuple(MOVE * np.eye(3)[axis]))),
            MOVE,
        )
        for axis in range(3)
    },
    **{
        f"robot turned about {'xyz'[axis]}": (
            3 + axis,
            replace(
                SETUP,
                phantom_from_robot=small_motion(
                    np.append(np.zeros(3), 2e-3 * np.eye(3)[axis]), PIVOT
                ),
            ),
            2e-3,
        )
        for axis in range(3)
    },
    "radius": (TOOL_COLUMNS, _wider(MOVE), MOVE),
    "camera": (TOOL_COLUMNS + 1, _camera_lifted(1e-4), 1e-4),
    "lump": (
        TOOL_COLUMNS + 2,
        replace(
            SETUP,
            material=replace(
                SETUP.material, inclusions=(replace(LUMP, stiffness_ratio=RATIO.value(0.02)),)
            ),
        ),
        0.02,
    ),
}


TOUCHED = replace(SETUP, landmarks=CORNERS[:3])
"""Three corners: what is wrong with their touches turns the tool."""
NEAR = {
    "depth_bias offset": DepthBias(offset=1e-6, scale=1.0),
    "depth_bias scale": DepthBias(offset=0.0, scale=1.0 + 1e-5),
    "geometry_scale x": GeometryScale(scale_x=1.0 + 1e-5, scale_y=1.0, scale_z=1.0),
    "geometry_scale z": GeometryScale(scale_x=1.0, scale_y=1.0, scale_z=1.0 + 1e-5),
    "landmark_mismatch inset": LandmarkMismatch(pairing="as-paired", scale=1.0, inset=1e-5),
}
"""Whose columns are compared with what twenty such steps do."""


@pytest.fixture(scope="module")
def data() -> Observations:
    """Two pushes, and a look at the untouched block, just as the stated setup has them."""
    return observed(SETUP, CENTRES, noise=0.0)


@pytest.fixture(scope="module")
def baseline(data) -> Prediction:
    """The stated setup, with every kind of column."""
    return predict(data, SETUP, GRID, WANTED, tolerance=TIGHT)


def _again(data: Observations, setup: Setup, baseline: Prediction) -> Prediction:
    return predict(data, setup, GRID, None, baseline.equilibria, TIGHT, baseline.samples)


@pytest.mark.parametrize("name", CHANGES)
def test_column_is_the_difference_of_two_predictions(data, baseline, name):
    column, changed, step = CHANGES[name]
    after = _again(data, changed, baseline)
    assert not after.failed
    difference = (after.gap - baseline.gap) / step
    seen = np.isfinite(difference)
    found = np.where(seen, baseline.columns[..., column], 0.0)
    wanted = np.where(seen, difference, 0.0)
    touched = np.linalg.norm(wanted[1:])
    assert touched > 0
    assert np.linalg.norm(found[1:] - wanted[1:]) < 0.02 * touched
    if name != "camera":
        assert not wanted[0].any() and not found[0].any()


@pytest.fixture(scope="module")
def of_touched(data) -> Prediction:
    """The stated setup on elements that grow with the block, with the columns of all in NEAR."""
    wanted = JacobianRequest(
        setups=tuple(effect.apply(TOUCHED) for effect in NEAR.values()),
        steps=(1.0,) * len(NEAR),
        pivot=PIVOT,
    )
    return predict(data, TOUCHED, GROWING, wanted, tolerance=TIGHT)


@pytest.mark.parametrize("name", NEAR)
def test_column_of_what_the_registrations_rest_on_is_the_difference_of_two_predictions(
    data, of_touched, name
):
    effect, neutral = NEAR[name], type(NEAR[name]).neutral(TOUCHED)
    pairs = zip(effect.coordinates, neutral.coordinates, strict=True)
    far = neutral.moved([zero + 20 * (here - zero) for here, zero in pairs]).apply(TOUCHED)
    after = predict(data, far, GROWING, None, of_touched.equilibria, TIGHT, of_touched.samples)
    difference = (after.gap - of_touched.gap) / 20
    found = np.where(
        np.isfinite(difference), of_touched.columns[..., TOOL_COLUMNS + list(NEAR).index(name)], 0.0
    )
    wanted = np.nan_to_num(difference)
    assert np.linalg.norm(wanted) > 0
    # What a registration keeps in place only slides along the dent, and the kinks between coarse
    # elements are no slope of it.
    tolerance = 0.25 if name == "geometry_scale x" else 0.05
    assert np.linalg.norm(found - wanted) < tolerance * np.linalg.norm(wanted)


@pytest.mark.parametrize(
    "effect",
    [DepthBias(offset=1e-3, scale=1.03), GeometryScale(scale_x=1.03, scale_y=0.97, scale_z=0.96)],
    ids=["depth", "size"],
)
def test_block_that_was_registered_as_another_leaves_nothing_under_the_truth(effect):
    stated = replace(SETUP, landmarks=CORNERS)
    truth = effect.apply(stated)
    item = observed(truth, CENTRES, noise=0.0)
    believed = predict(item, stated, GRID)
    right = predict(item, truth, GRID)
    again = predict(item, truth, GRID, None, None, TIGHT, believed.samples)
    assert (
        right.gap.shape == again.gap.shape == believed.gap.shape
    )  # the patches are those of the stated block
    assert np.nanmax(np.abs(right.gap)) < 2e-5
    assert np.sqrt(np.nanmean(again.gap**2)) < 0.15 * np.sqrt(np.nanmean(believed.gap**2))


def test_where_a_grid_is_about_to_give_way_the_column_is_the_difference_over_a_motion_that_matters(
    monkeypatch,
):
    grid, half = GridSpec(nodes=(15, 11, 9), spacing=1.2e-3), 4e-4
    item = observed(SETUP, np.array([poke(7.1e-3, -0.0185, 6e-4)]), noise=0.0)
    ahead, behind = (
        replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, sign * half, 0.0))) for sign in (1, -1)
    )
    wanted = JacobianRequest(
        setups=(replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, 1e-6, 0.0))),),
        steps=(1e-6,),
        pivot=PIVOT,
    )
    here = predict(item, SETUP, grid, wanted, tolerance=TIGHT)
    there = [
        predict(item, side, grid, None, here.equilibria, TIGHT, here.samples).gap
        for side in (ahead, behind)
    ]
    change = (there[0] - there[1]) / (2 * half)

    def miss(column: FloatArray) -> float:
        return float(np.sqrt(np.nansum((column - change) ** 2) / np.nansum(change**2)))

    assert miss(here.columns[..., 1]) < 0.35
    assert miss(here.columns[..., TOOL_COLUMNS]) < 0.35
    criteria = replace(CRITERIA, derivatives=replace(CRITERIA.derivatives, most_response=np.inf))
    monkeypatch.setattr(columns_module, "CRITERIA", criteria)
    assert miss(predict(item, SETUP, grid, wanted, tolerance=TIGHT).columns[..., 1]) > 1.0


def test_truth_leaves_only_noise_and_the_stated_setup_more():
    item = observed(TRUTH, CENTRES, noise=2e-4)
    found, stated = predict(item, TRUTH, GRID), predict(item, SETUP, GRID, WANTED)
    white = found.spread / np.sqrt(np.maximum(found.count, 1))

    def misfit(gap: FloatArray) -> float:
        return float(
            np.sqrt(
                np.nanmean(
                    np.where(found.count >= 8, gap / np.maximum(white, 1e-9), np.nan)[1:] ** 2
                )
            )
        )

    assert misfit(found.gap) == pytest.approx(1.0, abs=0.15)
    assert misfit(stated.gap) > 1.25 * misfit(found.gap)
    # The columns lead from the stated setup most of the way to the truth.
    change = np.array([2e-4, 0.0, 1e-4, 0.0, 0.0, 0.0, 3e-4, 0.0, 0.0])
    assert misfit(stated.gap + stated.columns @ change) < 1.15 * misfit(found.gap)


def test_same_points_give_a_difference_without_their_noise():
    clean, noisy = (observed(SETUP, CENTRES[2:], noise=noise, count=9000) for noise in (0.0, 8e-4))
    changed = replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, 0.0, -3e-4)))
    quiet, loud = predict(clean, SETUP, GRID), predict(noisy, SETUP, GRID)
    wanted = _again(clean, changed, quiet).gap - quiet.gap
    same, anew = (
        _again(noisy, changed, loud).gap - loud.gap,
        predict(noisy, changed, GRID).gap - loud.gap,
    )
    scatter = np.nanmedian(loud.spread / np.sqrt(np.maximum(loud.count, 1)))
    assert np.nanmedian(np.abs(wanted)) > 0
    assert np.nanstd(same - wanted) < 0.3 * scatter
    assert np.nanstd(same - wanted) < 0.7 * np.nanstd(anew - wanted)


def test_noise_stays_what_it_is_under_a_model_that_turns_its_sides_to_the_camera():
    item = observed(SETUP, CENTRES[:1], noise=2e-3, count=20000)
    here = predict(item, SETUP, GRID)
    there = _again(item, replace(SETUP, load=Load(specific_weight_over_stiffness=4.0)), here)
    sides = SETUP.surface().patch_normals[:, 2] < 0.5
    kept = sides & (here.count[0] >= 8)
    change = np.median((there.spread[0, kept] / here.spread[0, kept]) ** 2) - 1
    assert abs(change) < 0.005
    assert np.nanmean(np.abs(there.gap[0, kept] - here.gap[0, kept])) > 3e-4


def test_reference_group_does_not_feel_the_cameras_later_shift(data):
    groups = (replace(data.groups[0], frames=(), reference=True), data.groups[0])
    item = replace(data, groups=groups)
    before, after = predict(item, SETUP, GRID, WANTED), predict(item, _camera_lifted(1e-3), GRID)
    top = SETUP.surface().patch_normals[:, 2] > 0.5
    assert (
        not before.columns[0].any() and np.nanmean(before.columns[1, top, TOOL_COLUMNS + 1]) > 0.5
    )
    moved = after.gap - before.gap
    assert np.nanmax(np.abs(moved[0])) == 0
    assert np.nanmedian(moved[1, top]) == pytest.approx(1e-3, rel=0.05)


def test_group_without_equilibrium_is_named_and_gains_nothing():
    centres = np.array([poke(2e-3), poke(0.7 * TOP), poke(2e-3)])
    times, stream = dwelling(centres)
    points = seen_points(rest(SETUP, GRID), 3000, 2e-4, 0)
    item = Observations("deep", times, stream, tuple(Group((n,), points, False) for n in range(3)))
    found = predict(item, SETUP, GRID, WANTED)
    assert found.failed == (1,)
    surface = SETUP.surface()
    # A baseline that did find its equilibrium there: in that group the failed model changes
    # nothing.
    honest = replace(found, equilibria=(found.equilibria[0],) * 3, gap=np.nan_to_num(found.gap))
    noise = Noise.of(
        honest,
        honest,
        surface,
        np.full(surface.patches, 1e-7),
        slice(TOOL_COLUMNS + 2, TOOL_COLUMNS + 3),
    )
    other, quiet = found.gap.copy(), found.columns.copy()
    other[1], quiet[1] = noise.residual[1], 0.0
    wanted = noise.block(replace(honest, gap=other, columns=quiet))
    assert np.allclose(noise.block(found).gram, wanted.gram)


def test_sagged_landmarks_correct_the_touches():
    landmarks = tuple(
        (x * SIZE[0] / 2, y * SIZE[1] / 2, TOP) for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    )
    sagging = replace(SETUP, landmarks=landmarks, load=Load(specific_weight_over_stiffness=1.5))
    found = touch_correction(sagging, GRID)
    corners = np.array(landmarks)
    assert np.allclose(
        found.apply(corners).mean(axis=0), rest(sagging, GRID).move(corners).mean(axis=0), atol=1e-9
    )
    assert found.translation[2] < -1e-4
    assert np.array_equal(touch_correction(replace(sagging, load=Load()), GRID).matrix, np.eye(4))


LOW = replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, 0.0, -1.7e-3)))


@pytest.fixture(scope="module")
def with_ball() -> Observations:
    """The tool is 1.7 mm lower than stated, so that cleaning has left points of it beside the
    dent."""
    item = observed(LOW, CENTRES, noise=1e-4)
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = 5e-3 * np.stack([0.94 * np.cos(angle), 0.94 * np.sin(angle), np.full(24, -0.34)], axis=1)
    groups = []
    for group, centre in zip(item.groups, item.centres(SETUP), strict=True):
        ball = ring + centre + [0.0, 0.0, -1.7e-3]
        points = np.concatenate([group.points, POSE.inverse().apply(ball[ball[:, 2] > TOP + 1e-3])])
        groups.append(replace(group, points=points))
    return replace(item, groups=tuple(groups))


def test_points_of_a_tool_that_is_elsewhere_are_no_error_of_the_surface(with_ball):
    stated = predict(with_ball, SETUP, GRID)
    right = predict(with_ball, LOW, GRID, None, None, TIGHT, stated.samples)
    touched = [number for number, group in enumerate(with_ball.groups) if not group.free]
    worst = {
        name: np.nanmax(np.abs(item.gap[touched]))
        for name, item in (("stated", stated), ("right", right))
    }
    assert worst["right"] < 3e-4
    assert worst["stated"] > 1e-3


def test_columns_count_the_points_of_the_tool(with_ball):
    near = replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, 0.0, -1.3e-3)))
    wanted = JacobianRequest(
        setups=(replace(near, tool=replace(near.tool, radius=5e-3 + RADIUS_STEP)),),
        steps=(RADIUS_STEP,),
        pivot=PIVOT,
    )
    stated = predict(with_ball, SETUP, GRID)
    here = predict(with_ball, near, GRID, wanted, None, TIGHT, stated.samples)
    lower, wider = (
        Tool(radius=5e-3, offset=(0.0, 0.0, -1.3e-3 + MOVE)),
        replace(near.tool, radius=5e-3 + MOVE),
    )
    for column, tool in ((2, lower), (TOOL_COLUMNS, wider)):
        there = predict(
            with_ball, replace(near, tool=tool), GRID, None, here.equilibria, TIGHT, stated.samples
        )
        change, found = np.nan_to_num((there.gap - here.gap) / MOVE), here.columns[..., column]
        # A point that goes over from the surface to the tool within the step makes a jump, which no
        # derivative shows.
        steady = np.abs(change - found) < 0.05
        assert steady.mean() > 0.98
        assert np.linalg.norm((found - change)[steady]) < 0.08 * np.linalg.norm(change[steady])
