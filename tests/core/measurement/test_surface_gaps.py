from __future__ import annotations

import numpy as np
import pytest
from shapes import box_surface

from palpate.foundation.arrays import FloatArray
from palpate.measurement.surface_gaps import gaps
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import Equilibrium, replay, rest
from palpate.setup.block_surface import SIDES
from palpate.setup.setup import Box, Setup, Shape, Tool

SIZE = (0.0687, 0.0393, 0.0358)
TOP = SIZE[2]
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
SURFACE = Box(size=SIZE).surface()
CAMERA = np.array([-0.19, -0.16, 0.28])


@pytest.fixture(scope="module")
def flat() -> Equilibrium:
    """The block untouched."""
    return rest(SETUP, GridSpec())


@pytest.fixture(scope="module")
def dented() -> Equilibrium:
    """The block under a ball pressed in by 5 mm."""
    centres = np.array([[0.0, 0.0, TOP + 5e-3 - depth] for depth in (2e-3, 5e-3)])
    return replay(SETUP, centres, GridSpec(nodes=(11, 9, 7), spacing=1.5e-3))[-1]


def _seen(
    frame: Equilibrium, count: int, seed: int, sides: tuple[str, ...] = ("+z", "-x", "-y")
) -> FloatArray:
    """Points (n, 3) [m] of the deformed surface that face the camera, spread evenly over the rest
    surface.
    """
    rng = np.random.default_rng(seed)
    low, high = (
        np.array([-SIZE[0] / 2, -SIZE[1] / 2, 0.0]),
        np.array([SIZE[0] / 2, SIZE[1] / 2, TOP]),
    )
    points = []
    for side in sides:
        sample = rng.uniform(low, high, (count // len(sides), 3))
        axis = "xyz".index(side[1])
        sample[:, axis] = (high if side[0] == "+" else low)[axis]
        points.append(frame.move(sample))
    return np.concatenate(points)


def _along_rays(points: FloatArray, shift: FloatArray | float) -> FloatArray:
    """Points moved away from the camera along their rays by `shift` [m]."""
    rays = points - CAMERA
    return points + rays / np.linalg.norm(rays, axis=1)[:, None] * np.asarray(shift)[..., None]


def test_triangles_cover_the_free_surface_and_face_outwards():
    corners = SURFACE.vertices[SURFACE.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    x, y, z = SIZE
    assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(
        x * y + 2 * x * z + 2 * y * z, rel=1e-12
    )
    for number, side in enumerate(SIDES):
        axis, sign = "xyz".index(side[1]), 1 if side[0] == "+" else -1
        assert (sign * normals[SURFACE.side == number, axis] > 0).all()


def test_patches_cover_the_surface_evenly_and_lie_where_they_say():
    centres = SURFACE.patch_centres
    side = np.repeat(np.arange(len(SIDES)), np.diff(SURFACE._layout[1]))
    assert len(centres) == SURFACE.patches == len(SURFACE.patch_normals)
    assert np.array_equal(SURFACE.patch_of(centres, side), np.arange(SURFACE.patches))
    for number, name in enumerate(SIDES):
        axis, sign = "xyz".index(name[1]), 1 if name[0] == "+" else -1
        here = SURFACE.patch_normals[side == number]
        assert (here[:, axis] == sign).all() and np.abs(here).sum() == len(here)


def test_every_point_of_a_side_has_a_patch_of_that_side():
    rng = np.random.default_rng(0)
    points = rng.uniform(
        [-SIZE[0] / 2, -SIZE[1] / 2, TOP], [SIZE[0] / 2, SIZE[1] / 2, TOP], (4000, 3)
    )
    patch = SURFACE.patch_of(points, np.zeros(4000, dtype=int))
    nx, ny = SURFACE._layout[0][0]
    counts = np.bincount(patch, minlength=nx * ny)
    assert len(counts) == nx * ny and counts.min() > 0.3 * counts.mean()
    away = np.abs(points - SURFACE.patch_centres[patch])
    assert (away <= np.array([SIZE[0] / nx, SIZE[1] / ny, 0]) / 2 + 1e-12).all()


@pytest.mark.parametrize("name", ["flat", "dented"])
def test_points_on_the_simulated_surface_have_no_gap(name, request):
    frame = request.getfixturevalue(name)
    found = gaps(_seen(frame, 6000, 1), CAMERA, frame, SURFACE)
    inner = SURFACE.edge_distance(found.foot, found.side) > 3e-3
    assert len(found.gap) > 4000
    assert np.median(np.abs(found.gap[inner])) < 2e-5
    assert abs(found.gap[inner].mean()) < 1e-5
    assert np.bincount(found.patch, minlength=SURFACE.patches).sum() == len(found.gap)


@pytest.mark.parametrize("offset", [-1.5e-3, 4e-4, 1.5e-3])
def test_offset_of_the_flat_top_is_found_with_its_sign(flat, offset):
    points = _seen(flat, 4000, 2, ("+z",)) + np.array([0.0, 0.0, offset])
    found = gaps(points, CAMERA, flat, SURFACE)
    top = found.side == SIDES.index("+z")
    assert top.mean() > 0.9
    assert np.allclose(found.gap[top], offset, atol=1e-7)


@pytest.mark.parametrize("name", ["flat", "dented"])
def test_noise_along_the_rays_leaves_no_bias(name, request):
    frame = request.getfixturevalue(name)
    sigma, offset = 1.5e-3, 4e-4
    points = _seen(frame, 30000, 3, ("+z",)) + np.array([0.0, 0.0, offset])
    noisy = _along_rays(points, sigma * np.random.default_rng(4).normal(size=len(points)))
    found = gaps(noisy, CAMERA, frame, SURFACE)
    inner = (found.side == SIDES.index("+z")) & (
        SURFACE.edge_distance(found.foot, found.side) > 6e-3
    )
    upward = offset * found.normal[:, 2]
    error = (found.gap - upward)[inner]
    assert abs(error.mean()) < 4 * error.std() / np.sqrt(inner.sum()) + 1e-5


def test_noise_leaves_no_bias_in_the_dent_itself(dented):
    points = _seen(dented, 60000, 5, ("+z",))
    noisy = _along_rays(points, 1e-3 * np.random.default_rng(6).normal(size=len(points)))
    found = gaps(noisy, CAMERA, dented, SURFACE)
    near = np.hypot(found.foot[:, 0], found.foot[:, 1]) < 8e-3
    near &= found.side == SIDES.index("+z")
    assert near.sum() > 1000
    assert abs(found.gap[near].mean()) < 4 * found.gap[near].std() / np.sqrt(near.sum()) + 2e-5


def test_points_off_the_block_at_an_edge_or_far_away_are_left_out(flat):
    points = np.array(
        [
            [0.0, 0.0, TOP],
            [0.2, 0.2, 0.0],  # the table beside the block
            [0.0, 0.0, TOP + 0.02],  # too far above
            [SIZE[0] / 2 - 5e-4, 0.0, TOP],  # on an edge
        ]
    )
    found = gaps(points, CAMERA, flat, SURFACE)
    assert found.index.tolist() == [0]


def test_points_near_an_edge_that_a_filter_rounds_are_left_out(flat):
    points = np.array([[SIZE[0] / 2 - away, 0.0, TOP] for away in (2e-3, 3.9e-3, 4.1e-3)])
    rounded = Box(size=SIZE).surface(edge=4e-3)
    assert gaps(points, CAMERA, flat, SURFACE).index.tolist() == [0, 1, 2]
    assert gaps(points, CAMERA, flat, rounded).index.tolist() == [2]


def test_sides_that_the_camera_grazes_are_left_out(flat):
    above = np.array([-0.10, 0.0, 0.50])
    found = gaps(_seen(flat, 3000, 7, ("-x",)), above, flat, SURFACE)
    assert not (found.side == SIDES.index("-x")).any()


def test_block_as_a_surface_of_triangles_gives_the_same_gaps(dented: Equilibrium) -> None:
    points = _along_rays(_seen(dented, 3000, 5), 1e-3)
    one = gaps(points, CAMERA, dented, SURFACE)
    other = gaps(points, CAMERA, dented, Shape(*box_surface(SIZE)).surface())
    both = np.intersect1d(one.index, other.index)
    assert len(both) > 0.99 * max(len(one.index), len(other.index))
    apart = one.gap[np.isin(one.index, both)] - other.gap[np.isin(other.index, both)]
    # In the dent the triangles of both differ, and so do their normals.
    assert np.median(np.abs(apart)) < 1e-6 and np.quantile(np.abs(apart), 0.99) < 5e-5
