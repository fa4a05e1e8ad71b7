"""Criteria by which an equilibrium that was found in a jump of the tool is doubted, and checked.

A ball that is pressed deep at once may come to rest in another equilibrium than by way of the
places between: thin tissue over a held floor folds, or is left beside the ball. Contact pushes and
never pulls; and where the jump met difficulties, its equilibrium must be that of small steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.fem.continuation import FREE_STEP
from palpate.fem.mesh_quadrature import surface_quadrature
from palpate.fem.model import ToolSphere
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.replay.equilibrium import Equilibrium

__all__ = ["agree", "is_doubtful", "parts_between", "pulls"]

_CHECKED_STEP = 0.5 * FREE_STEP
"""Longest step of the way by which a jump is checked [m]."""
_PULL = 0.5
"""Share of the force by which it may point into the body [1]: beside an edge the nearest normal is
not the one along which the tool was pressed."""
_AGREED = 0.05
"""Largest difference of the forces, and of the displacements, of two ways to one equilibrium [1].
Contact at more points (`BlockModel`) alone makes one of a few hundredths on a rough mesh."""


def pulls(frame: Equilibrium) -> bool:
    """Whether the body pulls a tool without friction inwards, which pressure cannot.

    The force is compared with the outward normal of the free surface at rest that is nearest to the
    tool's centre.
    """
    size = float(np.linalg.norm(frame.force))
    if not size:
        return False
    mesh, face = frame.mesh, frame.mesh.connectivity.element.face
    centre = frame.tool.centre - np.append(frame.slip, 0.0)
    places = surface_quadrature(mesh, face).places
    outward = _outward(places, mesh.connectivity.surface, mesh.nodes, face.gradients, centre)
    return float(frame.force @ outward) < -_PULL * size


@njit(cache=True)
def _outward(places: Any, surface: Any, nodes: Any, gradients: Any, centre: Any) -> Any:
    """Unit normal (3,) of a surface at the one of its points that is nearest to a centre.

    Args:
        places: (f, p, 3) of the points [m].
        surface: (f, b) nodes of the sides.
        nodes: (n, 3) [m].
        gradients: (p, b, 2) of the shape functions at the points.
        centre: (3,) [m].
    """
    nearest, side, point = np.inf, 0, 0
    for f in range(places.shape[0]):
        for q in range(places.shape[1]):
            square = 0.0
            for i in range(3):
                square += (places[f, q, i] - centre[i]) ** 2
            if square < nearest:
                nearest, side, point = square, f, q
    s, t = np.zeros(3), np.zeros(3)
    for a in range(surface.shape[1]):
        for i in range(3):
            s[i] += gradients[point, a, 0] * nodes[surface[side, a], i]
            t[i] += gradients[point, a, 1] * nodes[surface[side, a], i]
    normal = np.cross(s, t)
    return normal / np.linalg.norm(normal)


def is_doubtful(start: Equilibrium, frame: Equilibrium) -> bool:
    """Whether an equilibrium after a jump is to be checked by small steps.

    It is where it was found only at many more contact points than before.

    Args:
        start: frame at the start of the jump.
        frame: that was found.
    """
    was_dense = start.dense and start.in_contact
    return frame.outcome is Outcome.CONVERGED and frame.dense and not was_dense


def parts_between(before: ToolSphere, tool: ToolSphere, finer: int = 1) -> list[ToolSphere]:
    """Places of the tool on the way from `before` to `tool`, the last of them `tool` itself.

    There are none where the way is no longer than one step.

    Args:
        before: tool at the start.
        tool: tool at the end.
        finer: factor on the number of steps.
    """
    way: FloatArray = tool.centre - before.centre
    length = float(np.linalg.norm(way))
    if length <= FREE_STEP:
        return []
    parts = finer * int(np.ceil(length / _CHECKED_STEP))
    shares = np.arange(1, parts) / parts
    return [*(ToolSphere(before.centre + share * way, tool.radius) for share in shares), tool]


def agree(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether two frames with the tool at one place are the same equilibrium."""
    pairs = [(one.force, other.force)]
    if one.mesh is other.mesh:
        pairs.append((one.displacement, other.displacement))
    return all(
        np.linalg.norm(first - second) <= _AGREED * np.linalg.norm(first) for first, second in pairs
    )
