"""A rigid, frictionless sphere against the free surface, and the table under a detached base.

Both are penalties at the surface's quadrature points, not at nodes: a ball pushed deep would slip
between nodes. Stiffness is given over E, so that the shape does not depend on the modulus. A point
is only pushed when its outward normal faces the sphere's centre; without that test the far side of
the block can come to rest inside the ball. The test may be made at every evaluation, or once
before: then the energy does not jump where a point turns away while an equilibrium is sought.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = ["assemble_contact", "contact_energy"]


@njit(cache=True)
def _gap(
    positions: Any,
    face: Any,
    shapes: Any,
    gradients: Any,
    centre: Any,
    radius: float,
    flat: bool,
    facing: bool,
    direction: Any,
) -> float:
    """Signed gap of a surface point [m], negative inside the obstacle; `direction` gets the unit
    vector that opens the gap.
    """
    x, s, t = np.zeros(3), np.zeros(3), np.zeros(3)
    for a in range(face.shape[0]):
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
    away = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2]
    if (facing and away >= 0) or distance < 1e-9:
        return 1.0
    direction /= distance
    return distance - radius  # type: ignore[no-any-return]


@njit(cache=True)
def _in_reach(positions: Any, face: Any, centre: Any, radius: float, flat: bool) -> bool:
    """Cheap test that spares most faces the quadrature."""
    if flat:
        return True
    nearest, size = np.inf, 0.0
    for a in range(face.shape[0]):
        distance, length = 0.0, 0.0
        for i in range(3):
            distance += (positions[face[a], i] - centre[i]) ** 2
            length += (positions[face[a], i] - positions[face[0], i]) ** 2
        nearest, size = min(nearest, distance), max(size, length)
    return np.sqrt(nearest) < radius + np.sqrt(size)  # type: ignore[no-any-return]


@njit(cache=True)
def contact_energy(
    faces: Any,
    areas: Any,
    shapes: Any,
    gradients: Any,
    positions: Any,
    centre: Any,
    radius: float,
    flat: bool,
    facing: bool,
    stiffness: float,
) -> float:
    """Penalty energy over E [m^3]: stiffness/2 gap^2 over the touched area; stiffness over E [1/m].
    `flat` is the plane z = 0.

    With `facing` only points that face the sphere's centre are pushed, otherwise all that have an
    area.
    """
    direction, total = np.empty(3), 0.0
    for f in range(faces.shape[0]):
        if not _in_reach(positions, faces[f], centre, radius, flat):
            continue
        for q in range(shapes.shape[0]):
            if areas[f, q] == 0.0:
                continue
            gap = _gap(
                positions,
                faces[f],
                shapes[q],
                gradients[q],
                centre,
                radius,
                flat,
                facing,
                direction,
            )
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
    facing: bool,
    stiffness: float,
    bending: bool,
    slots: Any,
    force: Any,
    data: Any,
    resultant: Any,
) -> float:
    """Add the penalty's gradient over E to `force` (n, 3) [m^2], its tangent to `data` [m], the
    push on the body to `resultant`.

    `facing` as in `contact_energy`, `slots` (f, 3 b, 3 b) as in `assemble_elastic`; an empty `data`
    leaves the tangent out, `bending` False the part from the sphere's curvature, which is not
    positive. Returns the deepest penetration [m].
    """
    direction, deepest = np.empty(3), 0.0
    for f in range(faces.shape[0]):
        if not _in_reach(positions, faces[f], centre, radius, flat):
            continue
        for q in range(shapes.shape[0]):
            gap = _gap(
                positions,
                faces[f],
                shapes[q],
                gradients[q],
                centre,
                radius,
                flat,
                facing,
                direction,
            )
            if gap >= 0 or areas[f, q] == 0.0:
                continue
            deepest = max(deepest, -gap)
            weight = stiffness * areas[f, q]
            for i in range(3):
                resultant[i] -= weight * gap * direction[i]
                for a in range(faces.shape[1]):
                    force[faces[f, a], i] += weight * gap * direction[i] * shapes[q, a]
            if data.shape[0] == 0:
                continue
            bend = gap / (gap + radius) if bending else 0.0
            for i in range(3):
                for j in range(3):
                    value = weight * (1 - bend) * direction[i] * direction[j] + (
                        weight * bend if i == j else 0.0
                    )
                    for a in range(faces.shape[1]):
                        for b in range(faces.shape[1]):
                            slot = slots[f, 3 * a + i, 3 * b + j]
                            if slot >= 0:
                                data[slot] += value * shapes[q, a] * shapes[q, b]
    return deepest
