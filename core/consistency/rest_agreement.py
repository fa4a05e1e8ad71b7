"""The rest cloud against the untouched frames of the sequences: moves that are common to all."""

from __future__ import annotations

import numpy as np

from palpate.consistency.contact_timeline import ContactTimeline
from palpate.dataset import Dataset, Sequence
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.registration import Registration
from palpate.registration.rest_fit import nearest_rest_pose

__all__ = ["rest_doubts"]

MOVED, TURNED = 7e-3, np.radians(5.0)
"""Motion between the rest cloud and every sequence from which it is told [m, rad]: effects explain
6 mm and 4 degrees of the camera."""
_CLEAR = 3e-3
"""Gap of the tool from which the phantom is untouched [m]."""
_MOST_POINTS = 20_000
"""Points of a cloud that are used."""
_SEQUENCES = 3
"""Sequences that are looked at."""


def rest_doubts(dataset: Dataset, registration: Registration) -> tuple[str, ...]:
    """A sentence where all sequences show phantom or camera elsewhere than the rest cloud."""
    if not dataset.has_rest:
        return ()
    pose = registration.phantom_from_camera
    found: list[tuple[float, float]] = []
    for name in dataset.sequences:
        cloud = _untouched(dataset, dataset.sequence(name), registration)
        if cloud is None:
            continue
        motion = _motion(dataset, cloud, pose)
        if motion is None or (motion[0] < MOVED and motion[1] < TURNED):
            return ()
        found.append(motion)
        if len(found) == _SEQUENCES:
            break
    if not found:
        return ()
    way, turn = min(found)
    return (
        f"all sequences begin with the phantom {1e3 * way:.0f} mm and {np.degrees(turn):.0f} "
        f"degrees from where rest.ply shows it (under {1e3 * MOVED:.0f} mm and "
        f"{np.degrees(TURNED):.0f} degrees is expected): phantom or camera was moved after "
        "rest.ply was taken; take it again, or use an untouched cloud of a sequence in its place",
    )


def _untouched(
    dataset: Dataset, sequence: Sequence, registration: Registration
) -> FloatArray | None:
    """The last cloud (n, 3) [m], camera frame, before the tool first touches; None without."""
    if not len(sequence):
        return None
    timeline = ContactTimeline.of(dataset, sequence, registration.repaired.phantom_from_robot)
    gap = np.interp(sequence.cloud_times, timeline.time, timeline.gap)
    near = np.flatnonzero(gap < _CLEAR)
    before = int(near[0]) - 1 if len(near) else len(sequence) - 1
    return None if before < 0 else _thinned(sequence.cloud(max(before // 2, 0)))


def _thinned(cloud: FloatArray) -> FloatArray:
    return np.asarray(cloud[:: len(cloud) // _MOST_POINTS + 1])


def _motion(dataset: Dataset, cloud: FloatArray, pose: Transform) -> tuple[float, float] | None:
    """Motion [m, rad] from the registered pose to the one in which a cloud fits best; None where
    none is found.
    """
    try:
        found = nearest_rest_pose(cloud, dataset.geometry, pose, dataset.config.depth_sigma)
    except RegistrationError:
        return None
    motion = found @ pose.inverse()
    middle = 0.5 * (dataset.geometry.low + dataset.geometry.high)
    way = float(np.linalg.norm(motion.apply(middle[None])[0] - middle))
    return way, float(np.linalg.norm(motion.rotation_vector))
