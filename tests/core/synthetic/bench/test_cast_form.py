"""Casts that differ from their drawing by a smooth offset along the normals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.foundation.errors import EffectError
from palpate.setup.free_form.shape import Shape
from palpate.synthetic import Scenario, draw_shape_scenario, make_dataset, make_shape_dataset
from palpate.synthetic.bodies.cast_form import CastForm
from palpate.synthetic.bodies.shape_families import draw_shape
from palpate.synthetic.scenario.hidden_effects import HiddenEffect


def _offset_at(cast: Shape, stated: Shape, points: np.ndarray) -> np.ndarray:
    """Height (n,) [m] of the cast over points of the stated surface."""
    assert cast.triangles.shape[1] == stated.triangles.shape[1]
    return -cast.facing_free(points)[0]


def _away(stated: Shape, points: np.ndarray) -> np.ndarray:
    held = stated.corners[stated.held].reshape(-1, 3)
    return np.linalg.norm(points[:, None] - held, axis=2).min(axis=1)


@pytest.mark.parametrize("family", ["dome", "liver", "grooved"])
def test_offset_has_the_stated_rms_is_smooth_and_leaves_what_is_held(family: str) -> None:
    stated = draw_shape(family, 3)
    form = CastForm(3e-4, 5)
    cast, points = form.of(stated), stated.surface_points()
    height, far = _offset_at(cast, stated, points), _away(stated, points) > 5e-3
    assert np.sqrt(np.mean(height[far] ** 2)) == pytest.approx(3e-4, rel=0.12)
    assert np.abs(height).max() < 1.5e-3
    low = np.unique(cast.triangles[cast.held])
    np.testing.assert_array_equal(cast.vertices[low, 2], 0.0)
    assert np.sort(cast.corners[cast.held][..., :2].reshape(-1, 2), axis=0)[[0, -1]] == (
        pytest.approx(np.sort(stated.corners[stated.held][..., :2].reshape(-1, 2), axis=0)[[0, -1]])
    )
    near = np.linalg.norm(points[:, None] - points, axis=2)
    pairs = np.argwhere((near > 0) & (near < 2e-3) & far[:, None] & far)
    assert 15e-3 <= form.length <= 25e-3
    step = height[pairs[:, 0]] - height[pairs[:, 1]]
    assert np.sqrt(np.mean(step**2)) < 0.25 * 3e-4


def test_no_offset_is_the_stated_body_and_too_large_a_one_is_refused() -> None:
    stated = draw_shape("dome", 3)
    assert CastForm(0.0, 1).of(stated) is stated
    with pytest.raises(EffectError, match=r"rms = 0.003 m is outside 0 to 0.002 m"):
        CastForm(3e-3, 1)


@pytest.mark.more
def test_old_seeds_draw_what_they_drew_and_the_truth_states_the_cast(tmp_path: Path) -> None:
    drawn = draw_shape_scenario("dome", 0, 4)
    assert drawn.true == drawn.stated
    short = replace(drawn.scenario, sequences=("poke-top-01",), rate=0.5)
    hidden = HiddenEffect("geometry_local", {"rms": 5e-4})
    cases = {
        "plain": replace(drawn, scenario=short),
        "cast": replace(drawn, scenario=short, cast=1e-4),
        "hidden": replace(drawn, scenario=replace(short, effects=(hidden,))),
    }
    truths = {
        name: make_shape_dataset(tmp_path / name, one, 4).as_dict() for name, one in cases.items()
    }
    surfaces = {(tmp_path / name / "phantom.stl").read_bytes() for name in cases}
    clouds = {(tmp_path / name / "rest.ply").read_bytes() for name in cases}
    assert len(surfaces) == 1 and len(clouds) == 3
    assert [truths[name]["verdict"] for name in cases] == ["none", "none", "found"]
    assert truths["cast"]["cast_mm"] == 0.1 and "cast_mm" not in truths["plain"]
    assert truths["hidden"]["effects"] == [
        {"effect": "geometry_local", "parameters": {"rms": {"value": 5e-4, "unit": "m"}}}
    ]


def test_effect_is_drawn_where_it_is_asked_for_and_refused_in_a_block(tmp_path: Path) -> None:
    drawn = draw_shape_scenario("liver", 1, 7, ("geometry_local",))
    (hidden,) = drawn.scenario.effects
    assert hidden.effect == "geometry_local" and 3.5e-4 <= hidden.value("rms") <= 6e-4
    assert drawn.true != drawn.stated
    with pytest.raises(EffectError, match="in a shape"):
        make_dataset(tmp_path / "block", Scenario(effects=(hidden,)), 1)
