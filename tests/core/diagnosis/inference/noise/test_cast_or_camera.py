"""An offset of the body and a smooth error of the camera, told apart by the table."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.noise.camera_error_model import CameraErrors, camera_errors
from palpate.registration.pose import motion_jacobian
from palpate.setup.free_form.cast_modes import cast_modes
from palpate.synthetic.bodies.cast_form import CastForm
from palpate.synthetic.bodies.shape_families import draw_shape

DOME = draw_shape("dome", 5)
TOWARDS = np.array([0.5, 0.4, 0.77])


def _errors(cast: float, bias: float, seed: int) -> CameraErrors:
    """Errors that are found in a rest cloud of a dome on its table.

    Args:
        cast: RMS offset of the bench's cast [m].
        bias: of the camera, on dome and table [m].
        seed: of all.
    """
    surface, random = DOME.surface(), np.random.default_rng(seed)
    seen = surface.patch_normals @ TOWARDS > 0.25
    centres, normals = surface.patch_centres[seen], surface.patch_normals[seen]
    x, y = (grid.ravel() for grid in np.meshgrid(*2 * [np.arange(-0.09, 0.091, 0.012)]))
    table = np.column_stack([x, y, 0 * x])[np.hypot(x, y) > 0.05]
    places = np.concatenate([centres, table])
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    smooth = bias**2 * np.exp(-0.5 * (apart / 0.02) ** 2) + 1e-12 * np.eye(len(places))
    white = np.full(len(places), 1e-4**2)
    residual = np.linalg.cholesky(smooth) @ random.normal(size=len(places))
    residual += np.sqrt(white) * random.normal(size=len(places))
    residual[: len(centres)] -= CastForm(cast, seed).of(DOME).facing_free(centres)[0]
    directions = np.concatenate([normals, np.tile([0.0, 0.0, 1.0], (len(table), 1))])
    moved = motion_jacobian(places, np.array([0.0, 0.0, DOME.height]))
    free = np.einsum("ni,nij->nj", directions, moved)
    heights = np.zeros((len(places), cast_modes(DOME).heights.shape[1]))
    heights[: len(centres)] = cast_modes(DOME).at(centres)[0]
    form = CRITERIA.camera_error.cast_size**2 * heights @ heights.T
    return camera_errors(places, 0.4 - places @ TOWARDS, white, residual, free, form)


@pytest.mark.parametrize("seed", range(3))
def test_a_cast_is_told_from_a_camera_whose_error_is_smaller(seed: int) -> None:
    found = _errors(5e-4, 1e-4, seed)
    assert found.cast_gain > CRITERIA.camera_error.least_cast_gain and found.bias <= 2e-4


@pytest.mark.parametrize("seed", range(3))
def test_an_error_of_the_camera_is_no_cast(seed: int) -> None:
    for bias in (1e-4, 3e-4):
        assert _errors(0.0, bias, seed).cast_gain < CRITERIA.camera_error.least_cast_gain / 2
