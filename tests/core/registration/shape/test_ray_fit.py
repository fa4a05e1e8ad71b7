"""Refinement of a pose along rays."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.shape_registration import look
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.pose import motion_jacobian, small_motion
from palpate.registration.shape.ray_fit import BODY, TABLE, on_surface, refined
from palpate.registration.shape.seen_body import SeenBody
from palpate.synthetic.bodies.shape_families import draw_shape

SHAPE = SeenBody(draw_shape("kidney", 0))


def _apart(one: Transform, other: Transform) -> float:
    """Largest distance [m] that points 40 mm around the body's middle are moved apart."""
    around = SHAPE.middle + 0.04 * np.vstack([np.eye(3), -np.eye(3)])
    return float(np.linalg.norm((one @ other.inverse()).apply(around) - around, axis=1).max())


@pytest.mark.parametrize("table", [True, False])
def test_pose_that_is_a_little_off_is_found_to_its_noise(table: bool) -> None:
    seen = look(SHAPE, 7, table=table)
    off = np.array([2e-3, -1e-3, 1e-3, 0.03, -0.02, 0.04])
    start = small_motion(off, SHAPE.middle) @ seen.pose
    found = refined(seen.cloud, SHAPE, start, 4e-3, table=table)
    assert _apart(start, seen.pose) > 3e-3
    assert _apart(found, seen.pose) < (0.3e-3 if table else 1e-3)


@pytest.mark.parametrize("seed", [1, 5])
def test_noise_along_rays_pulls_no_direction_however_weak(seed: int) -> None:
    """With noisy places in place of their feet, the weakest one was six deviations off."""
    body = SeenBody(draw_shape("dome", 0))
    seen = look(body, seed, table=False)
    found = on_surface(seen.cloud, body, seen.pose, 6e-3, table=False)
    rows = np.einsum("ki,kij->kj", found.normals, motion_jacobian(found.points, body.middle))
    rows = rows * [1, 1, 1, *[1 / body.reach] * 3] / (seen.noise * found.slant)[:, None]
    values, vectors = np.linalg.eigh(rows.T @ rows)
    pull = vectors.T @ (rows.T @ (found.distance / (seen.noise * found.slant)))
    assert np.abs(pull / np.sqrt(values)).max() < 3.5


def test_points_are_assigned_to_body_and_table_at_their_feet() -> None:
    seen = look(SHAPE, 3, table=True)
    found = on_surface(seen.cloud, SHAPE, seen.pose, 6e-3, table=True)
    points = seen.pose.apply(seen.cloud)[found.rows]
    on_table = found.face == TABLE
    assert on_table.any() and (found.face == BODY).any()
    assert np.abs(found.points[on_table, 2]).max() < 1e-9
    assert not found.sag[on_table].any() and (found.sag[~on_table] > 0).all()
    along = np.einsum("ni,ni->n", points - found.points, found.normals)
    assert np.allclose(along, found.distance, atol=1e-6)


def test_body_that_is_not_there_is_an_error() -> None:
    seen = look(SHAPE, 3, table=False)
    away = Transform(seen.pose.rotation, seen.pose.translation + 0.3)
    with pytest.raises(RegistrationError, match="points of the rest cloud lie on the phantom"):
        refined(seen.cloud, SHAPE, away, 4e-3, table=False)
