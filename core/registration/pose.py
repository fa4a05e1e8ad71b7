"""Small rigid motions about a pivot: the parameters of fits and covariances.

A vector (tx, ty, tz, rx, ry, rz), translation [m] first, then rotation vector [rad], both along the
axes of the phantom frame, moves x to pivot + R(r) (x - pivot) + t. A covariance (6, 6) of a
registration is that of this vector in true = small_motion(vector, pivot) @ stated, so translation
errors are those of the pivot itself.
"""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["motion_jacobian", "small_motion"]


def small_motion(vector: FloatArray, pivot: FloatArray) -> Transform:
    """The motion (6,) [m, rad] about `pivot` (3,) [m], phantom frame."""
    turn = Transform.from_vector(np.zeros(3), vector[3:])
    return Transform(turn.rotation, pivot + vector[:3] - turn.rotation @ pivot)


def motion_jacobian(points: FloatArray, pivot: FloatArray) -> FloatArray:
    """Derivative (n, 3, 6) of points (n, 3) [m] by the parameters at zero, [1, -[x - pivot]x]."""
    arm = points - pivot
    jacobian = np.zeros((len(points), 3, 6))
    jacobian[:, :, :3] = np.eye(3)
    jacobian[:, 0, 4], jacobian[:, 0, 5] = arm[:, 2], -arm[:, 1]
    jacobian[:, 1, 3], jacobian[:, 1, 5] = -arm[:, 2], arm[:, 0]
    jacobian[:, 2, 3], jacobian[:, 2, 4] = arm[:, 1], -arm[:, 0]
    return jacobian
