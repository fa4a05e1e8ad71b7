"""A cast's smooth offset from its drawing: modes, surface, mesh and what a report states."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from palpate.effects.geometry import GeometryLocal, GeometryScale
from palpate.foundation.errors import SetupError
from palpate.measurement.touch_correction import touched_places
from palpate.mesh.push_meshes import REPLAY_PUSHES
from palpate.mesh.tet_mesh import sides_of
from palpate.setup.free_form.cast_modes import CAST_MODES, cast_modes
from palpate.setup.setup import Box, Setup, Tool
from palpate.synthetic.bodies.cast_form import CastForm
from palpate.synthetic.bodies.shape_families import draw_shape

DOME = draw_shape("dome", 3)
TOP = np.array([[0.0, 0.0, DOME.height]])
STATED = Setup(geometry=DOME, tool=Tool(radius=5e-3), landmarks=((0.0, 0.0, DOME.height),))


def _closest(form: CastForm) -> tuple[GeometryLocal, np.ndarray]:
    """The effect that is nearest to a cast of the bench, and what it leaves (n,) [m]."""
    modes = cast_modes(DOME)
    heights = modes.heights[modes.free]
    wanted = -form.of(DOME).facing_free(modes.places[modes.free])[0]
    found = np.linalg.lstsq(
        np.vstack([heights, 0.05 * np.eye(CAST_MODES)]),
        np.concatenate([wanted, np.zeros(CAST_MODES)]),
    )[0]
    return GeometryLocal.of(found.tolist()), wanted - heights @ found


def test_modes_hold_the_casts_of_the_bench_and_nothing_of_what_is_held() -> None:
    assert len(GeometryLocal.numbers()) == CAST_MODES
    modes = cast_modes(DOME)
    assert (modes.heights[modes.free] ** 2).sum(axis=1).mean() == pytest.approx(1.0, abs=0.05)
    assert np.abs(modes.heights[modes.places[:, 2] < 1e-6]).max() < 1e-9
    effect, left = _closest(CastForm(4e-4, 1))
    assert np.sqrt(np.mean(left**2)) < 4e-5
    assert effect.reported(STATED)["rms"][0] == pytest.approx(4e-4, rel=0.03)


def test_mesh_and_surface_are_those_of_the_cast() -> None:
    form = CastForm(5e-4, 2)
    effect, cast = _closest(form)[0], form.of(DOME)
    setup, grid = effect.apply(STATED), REPLAY_PUSHES.at(TOP)
    plain, mesh = grid.mesh(STATED, TOP[0]), grid.mesh(setup, TOP[0])
    assert mesh is grid.mesh(setup, TOP[0])
    surface = np.unique(sides_of(mesh.tetrahedra)[~mesh.held])
    before, after = (np.abs(cast.facing_free(one.corners[surface])[0]) for one in (plain, mesh))
    assert after.mean() < 0.1 * before.mean()
    base = np.unique(sides_of(mesh.tetrahedra)[mesh.held])
    np.testing.assert_array_equal(mesh.corners[base], plain.corners[base])
    volumes = [
        np.linalg.det(one.corners[one.tetrahedra[:, 1:]] - one.corners[one.tetrahedra[:, :1]])
        for one in (plain, mesh)
    ]
    assert (volumes[1] / volumes[0]).min() > 0.5
    drawn = setup.surface()
    assert np.abs(cast.facing_free(drawn.vertices[::7])[0]).mean() < 4e-5
    back = drawn.own(drawn.on_stated(drawn.vertices))
    np.testing.assert_allclose(back, drawn.vertices, atol=1e-5)
    assert touched_places(setup) == pytest.approx(
        np.array(STATED.landmarks) + setup.cast_motion(np.array(STATED.landmarks))
    )


def test_another_size_stretches_the_cast() -> None:
    effect = GeometryLocal.of([5e-4])
    scale = GeometryScale(scale_x=1.05, scale_y=1.0, scale_z=0.95)
    setup = scale.apply(effect.apply(STATED))
    plain = effect.apply(STATED)
    wanted = plain.surface().vertices * [1.05, 1.0, 0.95]
    np.testing.assert_allclose(setup.surface().vertices, wanted, atol=1e-12)
    grid = REPLAY_PUSHES.at(TOP)
    corners = grid.mesh(plain, TOP[0]).corners * [1.05, 1.0, 0.95]
    np.testing.assert_allclose(grid.mesh(setup, TOP[0]).corners, corners, atol=1e-12)


def test_report_states_rms_and_a_field_and_no_coefficients() -> None:
    effect = GeometryLocal.of([5e-4, 0.0, -2e-4])
    assert set(effect.reported(STATED)) == {"rms"}
    field = json.loads(json.dumps(effect.located(STATED)))["field"]
    places, offset = np.array(field["places"]), np.array(field["offset"])
    assert places.shape == (len(offset), 3) and np.abs(DOME.facing(places)[0]).max() < 1e-4
    assert np.sqrt(np.mean(offset**2)) == pytest.approx(effect.reported(STATED)["rms"][0], rel=0.2)
    assert "by 0.31\N{NO-BREAK SPACE}mm RMS" in effect.phrase({"rms": 3.1e-4})


def test_block_has_no_local_offset() -> None:
    block = Setup(geometry=Box(size=(0.06, 0.04, 0.03)), tool=Tool(radius=5e-3))
    assert GeometryLocal.neutral(block).apply(block) == block
    with pytest.raises(SetupError, match="state the block's surface as a file"):
        GeometryLocal.of([1e-4]).apply(block)
    with pytest.raises(SetupError, match="cast has 2 coefficients; state 24, or none"):
        replace(STATED, cast=(1e-4, 2e-4))
