"""The touches that the robot's registration rests on, under another belief about where they were
made.

A registration lays the touches on their landmarks by the best rigid motion. If the landmarks
sagged, the block has another size, or the touches were of other places, then the same touches, laid
on where they really were, give another registration. The touches are known only through what they
left: moved by the stated registration they lie at landmark plus miss, so that a fit from there
leads from the stated registration to the true one, exactly, for any number of touches and however
far off the stated one is. Without misses it is the fit of the landmarks themselves, which is exact
too where the touches were: a rigid fit's inverse is the fit back.

A polygon that shrank about its middle lies as well as before: it moves nothing, and shows in the
misses alone.
"""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.mesh.protocol import Meshing
from palpate.registration.robot_fit import rigid_fits
from palpate.replay.replay import rest
from palpate.setup.setup import Setup, Touching

__all__ = ["touch_correction", "touch_misses", "touched_places"]


def touched_places(setup: Setup) -> FloatArray:
    """Where on the block at rest each touch really was, before it sagged (n, 3) [m], phantom
    frame."""
    landmarks, touching = np.array(setup.landmarks) * setup.scale, setup.touching
    places = landmarks[touching.order(len(landmarks))]
    middle = places.mean(axis=0)
    inwards = np.sign(np.round(middle - places, 9)) * np.array([1.0, 1.0, 0.0])
    return np.asarray(middle + touching.scale * (places - middle) + touching.inset * inwards)


def touch_correction(setup: Setup, grid: Meshing) -> Transform:
    """Stated to true phantom_from_robot; the grid is for the sag of the landmarks."""
    if _as_stated(setup):
        return Transform()
    made, places = _made_and_meant(setup, grid)
    rotation, translation, _ = rigid_fits(made, places[None])
    return Transform(rotation[0], translation[0])


def touch_misses(setup: Setup, grid: Meshing) -> FloatArray:
    """Each moved touch minus where the tool's centre would have been (n, 3) [m], phantom frame,
    under this setup's registration.
    """
    made, places = _made_and_meant(setup, grid)
    rotation, translation, _ = rigid_fits(made, places[None])
    return np.asarray(made @ rotation[0].T + translation[0] - places)


def _as_stated(setup: Setup) -> bool:
    """Whether the touches were where they were stated to be; with fewer than three, nothing was
    registered by them.
    """
    plain = Touching(misses=setup.touching.misses, lift=setup.touching.lift)
    moved = (
        setup.load.specific_weight_over_stiffness
        or setup.registered is not None
        or setup.touching != plain
    )
    return len(setup.landmarks) < 3 or not moved


def _made_and_meant(setup: Setup, grid: Meshing) -> tuple[FloatArray, FloatArray]:
    """Tool centres (n, 3) [m] as the stated registration has them, and as they should be on the
    block as it is.
    """
    landmarks, lift = np.array(setup.landmarks), np.array([0.0, 0.0, setup.touching.lift])
    misses = np.array(setup.touching.misses) if setup.touching.misses else np.zeros_like(landmarks)
    places = touched_places(setup)
    if setup.load.specific_weight_over_stiffness:
        places = rest(setup, grid).move(places)
    return landmarks + misses + lift, places + lift
