"""The tool array of samples: position, orientation, velocity and force of the tool."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.dataset import Sequence
from palpate.dataset.tool_smoothing import SMOOTHING, averaged, smooth_centres
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["canonical_quaternions", "tool_columns"]


def canonical_quaternions(quaternions: FloatArray) -> FloatArray:
    """Return quaternions (n, 4) of the same rotations with a positive largest component.

    The quaternions q and -q are the same rotation, but different inputs of a network.
    """
    largest = np.take_along_axis(quaternions, np.abs(quaternions).argmax(axis=1)[:, None], axis=1)
    return np.asarray(quaternions * np.sign(largest))


def tool_columns(
    sequence: Sequence, times: FloatArray, phantom_from_robot: Transform, measured: bool
) -> FloatArray:
    """Return the tool array (n, 13) at times (n,), see `palpate.correction.samples.sample_store`.

    Args:
        sequence: the recorded sequence.
        times: (n,) times [s].
        phantom_from_robot: the robot registration.
        measured: whether to use the measured force; otherwise it is zero.
    """
    path = sequence.kinematics
    rows = np.clip(np.searchsorted(path.time, times), 0, len(path.time) - 1)
    turned = Rotation.from_matrix(phantom_from_robot.rotation) * Rotation.from_quat(
        path.quaternion[rows]
    )
    ahead, behind = (smooth_centres(path, times + step) for step in (SMOOTHING, -SMOOTHING))
    force = np.zeros((len(times), 3))
    if measured and sequence.forces is not None:
        force = phantom_from_robot.rotate(
            averaged(sequence.forces.time, sequence.forces.force, times)
        )
    centres = phantom_from_robot.apply(smooth_centres(path, times))
    velocity = phantom_from_robot.rotate(ahead - behind) / (2 * SMOOTHING)
    return np.concatenate(
        [centres, canonical_quaternions(turned.as_quat()), velocity, force], axis=1
    )
