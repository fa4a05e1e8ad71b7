"""Correction of the robot's registration for touches that were not at the stated landmarks, and for
traces over another surface than the stated one.

A registration fits the touches to their landmarks by a rigid motion. If the landmarks sagged, the
block has another size, or other places were touched, then the same touches, fitted to the true
places, give another registration. A setup stores the touches as residuals: moved by the stated
registration, a touch lies at landmark plus residual. The rigid fit from there to the true places
leads from the stated registration to the true one, exactly, for any number of touches and any size
of the error.

A touched polygon that is smaller about its middle moves nothing; it shows in the residuals alone.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.mesh.protocol import Meshing
from palpate.registration.robot.robot_fit import rigid_fits
from palpate.registration.robot.trace_fit import refit_traces
from palpate.replay.replay import rest
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Setup, Touching, Tracing

__all__ = ["touch_correction", "touch_misses", "touched_places"]


def touched_places(setup: Setup) -> FloatArray:
    """True places (n, 3) [m], phantom frame, of the touches on the block before it sags."""
    stated, touching = np.array(setup.landmarks), setup.touching
    landmarks = (stated + setup.cast_motion(stated)) * setup.scale
    places = landmarks[touching.order(len(landmarks))]
    middle = places.mean(axis=0)
    inwards = np.sign(np.round(middle - places, 9)) * np.array([1.0, 1.0, 0.0])
    return np.asarray(middle + touching.scale * (places - middle) + touching.inset * inwards)


def touch_correction(setup: Setup, grid: Meshing) -> Transform:
    """Motion from the stated to the true phantom_from_robot; `grid` is used for the sag."""
    if setup.tracing is not None:
        return _trace_correction(setup, setup.tracing, grid)
    if _as_stated(setup):
        return Transform()
    made, places = _touched_and_expected(setup, grid)
    rotation, translation, _ = rigid_fits(made, places[None])
    return Transform(rotation[0], translation[0])


def _trace_correction(setup: Setup, tracing: Tracing, grid: Meshing) -> Transform:
    """Motion that puts the traced points on the surface of the true body, as it sags.

    An offset of the cast, which waves over the traced surface, is taken not to move the fit.
    """
    sags, geometry = setup.load.specific_weight_over_stiffness, setup.geometry
    if not (sags or setup.registered is not None or setup.tool.radius != tracing.radius):
        return Transform()
    centres = np.array(tracing.centres)
    if sags:
        gaps, normals = geometry.facing(centres)
        feet = geometry.nearest(centres - gaps[:, None] * normals)
        centres = centres - (rest(setup, grid).move(feet) - feet)
    here = refit_traces(centres, geometry, setup.tool.radius)
    return here @ _as_traced(tracing, setup.stated_geometry).inverse()


@lru_cache(maxsize=16)
def _as_traced(tracing: Tracing, geometry: Geometry) -> Transform:
    """The motion that the same fit finds for the stated body and ball, where none is due."""
    return refit_traces(np.array(tracing.centres), geometry, tracing.radius)


def touch_misses(setup: Setup, grid: Meshing) -> FloatArray:
    """Residuals (n, 3) [m], phantom frame, of the touches after the corrected registration: moved
    touch minus expected tool centre.
    """
    made, places = _touched_and_expected(setup, grid)
    rotation, translation, _ = rigid_fits(made, places[None])
    return np.asarray(made @ rotation[0].T + translation[0] - places)


def _as_stated(setup: Setup) -> bool:
    """Whether the touches need no correction; fewer than three register nothing."""
    stated = setup.touching
    plain = Touching(
        misses=stated.misses, lift=stated.lift, normals=stated.normals, deviation=stated.deviation
    )
    moved = (
        setup.load.specific_weight_over_stiffness
        or setup.registered is not None
        or setup.cast
        or stated != plain
        or (stated.normals and stated.lift != setup.tool.radius)
    )
    return len(setup.landmarks) < 3 or not moved


def _touched_and_expected(setup: Setup, grid: Meshing) -> tuple[FloatArray, FloatArray]:
    """Tool centres (n, 3) [m] by the stated registration, and expected at the true places."""
    landmarks, touching = np.array(setup.landmarks), setup.touching
    up = np.array(touching.normals) if touching.normals else np.array([0.0, 0.0, 1.0])
    misses = np.array(touching.misses) if touching.misses else np.zeros_like(landmarks)
    places = touched_places(setup)
    if setup.load.specific_weight_over_stiffness:
        places = rest(setup, grid).move(places)
    # A ball that rests on the surface is off it by its true radius.
    lift = setup.tool.radius if touching.normals else touching.lift
    return landmarks + misses + touching.lift * up, places + lift * up
