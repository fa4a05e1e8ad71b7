"""A rigid, frictionless sphere against the free surface, and the table under a detached base.

Both are penalties at the surface's quadrature points, not at nodes: a ball pushed deep would slip between nodes. Stiffness is
given over E, so that the shape does not depend on the modulus. A point is only pushed when its outward normal faces the
sphere's centre; without that test the far side of the block can come to rest inside the ball.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from core.frames import FloatArray

__all__ = ["FACE_GRADIENTS", "FACE_SHAPES", "assemble_contact", "contact_energy", "face_weights", "turns_around"]

_GAUSS = np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
_GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 9.0
_POINTS = np.array([[s, t] for t in _GAUSS for s in _GAUSS])
_POINT_WEIGHTS = np.array([a * b for b in _GAUSS_WEIGHTS for a in _GAUSS_WEIGHTS])
_QUAD = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
FACE_SHAPES = np.ascontiguousarray(((1 + _POINTS[:, None] * _QUAD[None]) / 2).prod(axis=2))
FACE_GRADIENTS = np.ascontiguousarray(
    np.stack(
        [_QUAD[:, 0] / 2 * (1 + _POINTS[:, 1:] * _QUAD[:, 1]) / 2, _QUAD[:, 1] / 2 * (1 + _POINTS[:, :1] * _QUAD[:, 0]) / 2], axis=2
    )
)


def face_weights(corners: FloatArray) -> FloatArray:
    """Rest area [m^2] at the 3x3 Gauss points (f, 9) of quadrilaterals with corners (f, 4, 3) [m]."""
    tangents = np.einsum("qac,fai->fqci", FACE_GRADIENTS, corners)
    area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2)
    return np.asarray(area * _POINT_WEIGHTS)


@njit(cache=True)
def _gap(positions: Any, face: Any, shapes: Any, gradients: Any, centre: Any, radius: float, flat: bool, direction: Any) -> float:
    """Signed gap of a surface point [m], negative inside the obstacle; `direction` gets the unit vector that opens the gap."""
    x, s, t = np.zeros(3), np.zeros(3), np.zeros(3)
    for a in range(4):
        for i in range(3):
            x[i] += shapes[a] * positions[face[a], i]
            s[i] += gradients[a, 0] * positions[face[a], i]
            t[i] += gradients[a, 1] * positions[face[a], i]
    if flat:
        direction[0], direction[1], direction[2] = 0.0, 0.0, 1.0
        return x[2]  # type: ignore[no-any-return]
    distance = 0.0
    for i in range(3):
        direction[i] = x[i] - centre[i]
        distance += direction[i] ** 2
    distance = np.sqrt(distance)
    if distance >= radius:
        return 1.0
    normal = np.cross(s, t)
    facing = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2]
    if facing >= 0 or distance < 1e-9:
        return 1.0
    direction /= distance
    return distance - radius  # type: ignore[no-any-return]


@njit(cache=True)
def _in_reach(positions: Any, face: Any, centre: Any, radius: float, flat: bool) -> bool:
    """Cheap test that spares most faces the quadrature."""
    if flat:
        return True
    nearest, edge = np.inf, 0.0
    for a in range(4):
        distance, length = 0.0, 0.0
        for i in range(3):
            distance += (positions[face[a], i] - centre[i]) ** 2
            length += (positions[face[a], i] - positions[face[(a + 1) % 4], i]) ** 2
        nearest, edge = min(nearest, distance), max(edge, length)
    return np.sqrt(nearest) < radius + np.sqrt(edge)  # type: ignore[no-any-return]


@njit(cache=True)
def contact_energy(
    faces: Any, areas: Any, shapes: Any, gradients: Any, positions: Any, centre: Any, radius: float, flat: bool, stiffness: float
) -> float:
    """Penalty energy over E [m^3]: stiffness/2 gap^2 over the touched area; stiffness over E [1/m]. `flat` is the plane z = 0."""
    direction, total = np.empty(3), 0.0
    for f in range(faces.shape[0]):
        if not _in_reach(positions, faces[f], centre, radius, flat):
            continue
        for q in range(9):
            gap = _gap(positions, faces[f], shapes[q], gradients[q], centre, radius, flat, direction)
            if gap < 0:
                total += 0.5 * stiffness * areas[f, q] * gap * gap
    return total


@njit(cache=True)
def assemble_contact(
    faces: Any,
    areas: Any,
    shapes: Any,
    gradients: Any,
    positions: Any,
    centre: Any,
    radius: float,
    flat: bool,
    stiffness: float,
    bending: bool,
    slots: Any,
    force: Any,
    data: Any,
    resultant: Any,
) -> float:
    """Add the penalty's gradient over E to `force` (n, 3) [m^2], its tangent to `data` [m], the push on the body to `resultant`.

    `slots` (f, 12, 12) as in `assemble_elastic`; an empty `data` leaves the tangent out,
    `bending` False the part from the sphere's curvature, which is not positive. Returns the deepest penetration [m].
    """
    direction, deepest = np.empty(3), 0.0
    for f in range(faces.shape[0]):
        if not _in_reach(positions, faces[f], centre, radius, flat):
            continue
        for q in range(9):
            gap = _gap(positions, faces[f], shapes[q], gradients[q], centre, radius, flat, direction)
            if gap >= 0:
                continue
            deepest = max(deepest, -gap)
            weight = stiffness * areas[f, q]
            for i in range(3):
                resultant[i] -= weight * gap * direction[i]
                for a in range(4):
                    force[faces[f, a], i] += weight * gap * direction[i] * shapes[q, a]
            if data.shape[0] == 0:
                continue
            bend = gap / (gap + radius) if bending else 0.0
            for i in range(3):
                for j in range(3):
                    value = weight * (1 - bend) * direction[i] * direction[j] + (weight * bend if i == j else 0.0)
                    for a in range(4):
                        for b in range(4):
                            slot = slots[f, 3 * a + i, 3 * b + j]
                            if slot >= 0:
                                data[slot] += value * shapes[q, a] * shapes[q, b]
    return deepest


@njit(cache=True)
def turns_around(faces: Any, positions: Any, point: Any) -> float:
    """How often quadrilaterals (f, 4) wind around a point (3,): over a closed surface 1 inside and 0 outside.

    Sum of the triangles' solid angles (van Oosterom and Strackee 1983) over that of the sphere.
    """
    total, arms, lengths = 0.0, np.empty((3, 3)), np.empty(3)
    for f in range(faces.shape[0]):
        for second in (1, 2):
            for corner, a in enumerate((0, second, second + 1)):
                for i in range(3):
                    arms[corner, i] = positions[faces[f, a], i] - point[i]
                lengths[corner] = np.sqrt(arms[corner, 0] ** 2 + arms[corner, 1] ** 2 + arms[corner, 2] ** 2)
            a, b, c = arms[0], arms[1], arms[2]
            across = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
            along = lengths[0] * lengths[1] * lengths[2]
            for i in range(3):
                along += a[i] * b[i] * lengths[2] + b[i] * c[i] * lengths[0] + c[i] * a[i] * lengths[1]
            total += 2 * np.arctan2(across, along)
    return total / (4 * np.pi)
