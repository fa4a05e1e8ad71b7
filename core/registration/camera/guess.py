"""Automatic first guess of camera to phantom: table plane, top at the block's height, rectangle."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.table_plane import TablePlane, find_table

__all__ = ["automatic_guess", "half_turn", "level"]

HEADING_STEP = np.radians(0.5)
"""Step of the search over headings [rad]."""


def half_turn() -> Transform:
    """Half a turn about the phantom's z axis, which maps the block onto itself."""
    return Transform(np.diag([-1.0, -1.0, 1.0]))


def automatic_guess(
    cloud: FloatArray, size: tuple[float, float, float], depth_sigma: float
) -> Transform:
    """Guess phantom_from_camera from a rest cloud (n, 3) [m], camera frame, and the block's size
    [m].

    The result is one of two headings half a turn apart, which a plain block cannot distinguish.
    Raises RegistrationError where no table or no top is found.
    """
    thickness = max(depth_sigma, 1.0e-3)
    table = find_table(cloud, thickness)
    level_from_camera = level(table)
    points = level_from_camera.apply(cloud)
    top = _block_top(points, size, thickness)
    heading, centre = _rectangle(top[:, :2], size[0], size[1])
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return Transform(turn, -turn @ np.array([centre[0], centre[1], 0.0])) @ level_from_camera


def level(table: TablePlane) -> Transform:
    """Transform from the camera frame to one whose plane z = 0 is the table, z upwards."""
    z = table.normal
    x = np.cross([0.0, 1.0, 0.0], z)
    x = np.cross([1.0, 0.0, 0.0], z) if np.linalg.norm(x) < 0.1 else x
    x /= np.linalg.norm(x)
    return Transform(np.stack([x, np.cross(z, x), z]), np.array([0.0, 0.0, -table.offset]))


def _block_top(
    points: FloatArray, size: tuple[float, float, float], thickness: float
) -> FloatArray:
    """The largest cluster (k, 3) at the block's height among levelled points (n, 3)."""
    import open3d as o3d

    layer = points[np.abs(points[:, 2] - size[2]) < max(2.5 * thickness, 0.08 * size[2])]
    if len(layer) < 30:
        raise RegistrationError(
            f"{len(layer)} points of the rest cloud lie {size[2] * 1e3:.1f} mm over the table, "
            "where the phantom's top should be: "
            "check [phantom] size, or give [camera] to_phantom as a first guess"
        )
    flat = layer * np.array([1.0, 1.0, 0.0])
    spacing = np.sqrt(size[0] * size[1] / len(layer))
    labels = np.asarray(
        o3d.geometry.PointCloud(o3d.utility.Vector3dVector(flat)).cluster_dbscan(
            eps=3.0 * spacing, min_points=8
        )
    )
    if labels.max() < 0:
        raise RegistrationError(
            "the points at the height of the phantom's top do not hang together: give [camera] "
            "to_phantom"
        )
    return np.asarray(layer[labels == np.bincount(labels[labels >= 0]).argmax()])


def _rectangle(points: FloatArray, length: float, width: float) -> tuple[float, FloatArray]:
    """Heading [rad] and centre (2,) [m] of the rectangle of known sides whose robust extents fit
    points (n, 2) best.
    """
    headings = np.arange(0.0, np.pi, HEADING_STEP)
    axes = np.stack([np.cos(headings), np.sin(headings)])
    low, high = np.percentile(points @ axes, [1.0, 99.0], axis=0)
    low_across, high_across = np.percentile(
        points @ np.stack([-axes[1], axes[0]]), [1.0, 99.0], axis=0
    )
    misfit = (high - low - length) ** 2 + (high_across - low_across - width) ** 2
    # The extents are stationary at the right heading; the smallest area decides near ties.
    best = int(np.argmin(misfit + 0.05 * (high - low) * (high_across - low_across)))
    along, across = (low[best] + high[best]) / 2, (low_across[best] + high_across[best]) / 2
    axis = axes[:, best]
    return float(headings[best]), along * axis + across * np.array([-axis[1], axis[0]])
