"""Contact of a rigid, frictionless sphere with the free surface, and of a detached base with the
table.

Both are penalties at the surface's quadrature points instead of nodes: a ball pushed deep would
slip between nodes. The stiffness is over E, so that the shape does not depend on the modulus. A
point is pushed only if its outward normal faces the sphere's centre; otherwise the far side of the
body could come to rest inside the ball. The test is made at every evaluation, or once before a
solve: then the energy does not jump where a point turns away during the solve.
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
    """Signed gap of a surface point [m], negative inside the obstacle.

    `direction` receives the unit vector that opens the gap.
    """
    x, y, z = 0.0, 0.0, 0.0
    for a in range(face.shape[0]):
        share, node = shapes[a], face[a]
        x += share * positions[node, 0]
        y += share * positions[node, 1]
        z += share * positions[node, 2]
    if flat:
        direction[0], direction[1], direction[2] = 0.0, 0.0, 1.0
        return z
    x, y, z = x - centre[0], y - centre[1], z - centre[2]
    distance = np.sqrt(x * x + y * y + z * z)
    if distance >= radius or distance < 1e-9:
        return 1.0
    if facing and _outward_part(positions, face, gradients, x, y, z) >= 0:
        return 1.0
    direction[0], direction[1], direction[2] = x / distance, y / distance, z / distance
    return distance - radius  # type: ignore[no-any-return]


@njit(cache=True)
def _outward_part(positions: Any, face: Any, gradients: Any, x: float, y: float, z: float) -> float:
    """Product of a side's outward normal, not of unit length, at a point and a vector."""
    s_x = s_y = s_z = t_x = t_y = t_z = 0.0
    for a in range(face.shape[0]):
        node, along, across = face[a], gradients[a, 0], gradients[a, 1]
        s_x += along * positions[node, 0]
        s_y += along * positions[node, 1]
        s_z += along * positions[node, 2]
        t_x += across * positions[node, 0]
        t_y += across * positions[node, 1]
        t_z += across * positions[node, 2]
    return (s_y * t_z - s_z * t_y) * x + (s_z * t_x - s_x * t_z) * y + (s_x * t_y - s_y * t_x) * z


@njit(cache=True)
def _in_reach(positions: Any, face: Any, centre: Any, radius: float, flat: bool) -> bool:
    """Whether a face may touch; a cheap test that excludes most faces from the quadrature."""
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
    """Penalty energy over E [m^3]: stiffness/2 gap^2 over the touched area.

    Args:
        faces: (f, b) nodes.
        areas: (f, p) weights of the points [m^2].
        shapes: (p, b) shape functions.
        gradients: (p, b, 2) of them.
        positions: (n, 3) [m].
        centre: of the sphere (3,) [m].
        radius: of the sphere [m].
        flat: the obstacle is the plane z = 0 instead of the sphere.
        facing: push only points that face the sphere's centre; otherwise all with an area.
        stiffness: over E [1/m].
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
    """Add the penalty's gradient, tangent and resultant; returns the deepest penetration [m].

    Args as in `contact_energy`, and:
        bending: False leaves out the tangent's part from the sphere's curvature, which is not
            positive.
        slots: (f, 3 b, 3 b) as in `assemble_elastic`.
        force: (n, 3) the gradient over E is added here [m^2].
        data: the tangent is added here [m]; empty leaves it out.
        resultant: (3,) the push on the body is added here [m^2].
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
