"""Obstacles in contact with the virtual block: ball, shaft, table and a neighbouring body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.mooney_rivlin import spread
from palpate.synthetic.solver.tet_block import Sampling, TetBlock

__all__ = ["SOFT_GAP", "Neighbour", "Obstacle", "Shaft", "assemble_obstacle", "shaft_radius"]

SOFT_GAP = 0.03e-3
"""Depth over which the contact pressure sets in quadratically [m]."""
CAUTIOUS_GAP = 0.02
"""Depth over the radius beyond which a `cautious` stiffness leaves out the curvature term [1]."""
_FAST = {"contract", "reassoc", "arcp", "nsz"}


def shaft_radius(ball: float) -> float:
    """Radius of the shaft of a ball of this radius [m]."""
    return min(3e-3, 0.8 * ball)


@dataclass(frozen=True)
class Shaft:
    """The rod that holds the ball.

    Attributes:
        away: (3,) unit vector from the ball along the rod.
        radius: [m].
        length: [m].
    """

    away: FloatArray
    radius: float
    length: float


@dataclass(frozen=True)
class Obstacle:
    """A ball, a shaft or a plane that presses on points of the block.

    Attributes:
        sampling: the points on which it acts.
        centre: (3,) centre of a ball, start of a shaft, or a point of a plane [m].
        along: (3,) axis of a shaft [m], zero for a ball; normal of a plane, towards the block.
        radius: [m]; 0 for a plane.
        penalty: pressure per depth [Pa/m].
        of_tool: whether its force belongs to the tool.
    """

    sampling: Sampling
    centre: FloatArray
    along: FloatArray
    radius: float
    penalty: float
    of_tool: bool


@dataclass(frozen=True)
class Neighbour:
    """A soft body against a face of the block: a bed of springs without friction.

    Attributes:
        axis: of the face's normal.
        sign: of its side.
        overlap: penetration of the block by the undeformed body [m].
        stiffness: pressure per displacement of the springs [Pa/m].
    """

    axis: int
    sign: float
    overlap: float
    stiffness: float

    def against(self, block: TetBlock) -> Obstacle:
        """The obstacle that presses on the points of that face."""
        skin = block.skin
        places = np.einsum("fqa,fai->fqi", skin.values, block.nodes[block.elements[skin.owner]])
        far = self.sign * places[..., self.axis]
        own = np.nonzero(np.all(far > far.max() - 1e-9, axis=1))[0]
        face = Sampling(
            skin.owner[own],
            np.ascontiguousarray(skin.values[own]),
            np.ascontiguousarray(skin.weights[own]),
        )
        inwards = -self.sign * np.eye(3)[self.axis]
        return Obstacle(
            face, (self.overlap - far.max()) * inwards, inwards, 0.0, self.stiffness, False
        )


@njit(cache=True, fastmath=_FAST)
def _depth(x: Any, centre: Any, along: Any, radius: float, n: Any) -> tuple[float, float, bool]:
    """Penetration of an obstacle by a point x (3,); fills the normal n (3,) where it is positive.

    Returns:
        depth [m], distance from centre or axis [m], and whether the point is beside the shaft.
    """
    reach = along[0] ** 2 + along[1] ** 2 + along[2] ** 2
    ahead = 0.0
    for i in range(3):
        ahead += (x[i] - centre[i]) * along[i]
    if radius <= 0:
        for i in range(3):
            n[i] = along[i]
        return -ahead, 1.0, False
    share = min(max(ahead / reach, 0.0), 1.0) if reach > 0 else 0.0
    squares = 0.0
    for i in range(3):
        n[i] = x[i] - centre[i] - share * along[i]
        squares += n[i] * n[i]
    distance = np.sqrt(squares)
    if distance >= radius or distance < 1e-9:
        return -1.0, distance, False
    for i in range(3):
        n[i] /= distance
    return radius - distance, distance, reach > 0 and 0.0 < share < 1.0


@njit(cache=True, fastmath=_FAST)
def assemble_obstacle(
    u: Any,
    nodes: Any,
    elements: Any,
    owner: Any,
    values: Any,
    areas: Any,
    centre: Any,
    along: Any,
    radius: float,
    penalty: float,
    cautious: bool,
    derivative: bool,
    stiffness: Any,
    force: Any,
    tool_force: Any,
    coupling: Any,
    total: Any,
) -> tuple[float, float]:
    """Assemble an `Obstacle` that presses on surface points; frictionless penalty [Pa/m].

    The pressure sets in quadratically over SOFT_GAP, because a kink makes Newton's method jump
    between sets of contact points. Where the block slides along a sphere, the direction of the
    pressure changes, and the stiffness can be negative. A `cautious` stiffness leaves that term out
    where the pressure is high.

    With `derivative`, adds to element stiffness (e, 10, 10, 3, 3) [N/m], nodal force (n, 3) [N],
    tool_force (3,) on the block [N], coupling (n, 3, 3) = -d force / d centre [N/m], and total
    (3, 3), its sum.

    Returns:
        energy [J] and deepest penetration [m].
    """
    energy = 0.0
    deepest = 0.0
    x = np.empty(3)
    n = np.empty(3)
    pull = np.empty(3)
    t = np.empty((3, 3))
    reach = max(np.sqrt(along[0] ** 2 + along[1] ** 2 + along[2] ** 2), 1e-12)
    for s in range(owner.shape[0]):
        element = elements[owner[s]]
        for q in range(areas.shape[1]):
            x[:] = 0.0
            for a in range(10):
                value = values[s, q, a]
                for i in range(3):
                    x[i] += value * (nodes[element[a], i] + u[element[a], i])
            gap, distance, beside = _depth(x, centre, along, radius, n)
            if gap <= 0:
                continue
            deepest = max(deepest, gap)
            stiff = penalty * areas[s, q]
            if gap < SOFT_GAP:
                pressure = 0.5 * stiff * gap * gap / SOFT_GAP
                energy += pressure * gap / 3
                slope = stiff * gap / SOFT_GAP
            else:
                pressure = stiff * (gap - 0.5 * SOFT_GAP)
                energy += stiff * (0.5 * gap * (gap - SOFT_GAP) + SOFT_GAP * SOFT_GAP / 6)
                slope = stiff
            if not derivative:
                continue
            bend = (
                pressure / distance
                if radius > 0 and (gap < CAUTIOUS_GAP * radius or not cautious)
                else 0.0
            )
            # Along its axis a shaft does not change the direction of the pressure.
            straight = bend / (reach * reach) if beside else 0.0
            for i in range(3):
                pull[i] = -pressure * n[i]
                tool_force[i] -= pull[i]
                for k in range(3):
                    t[i, k] = (
                        (slope + bend) * n[i] * n[k]
                        - (bend if i == k else 0.0)
                        + straight * along[i] * along[k]
                    )
                    total[i, k] += t[i, k]
            spread(values[s, q], element, pull, t, stiffness[owner[s]], force, coupling)
    return energy, deepest
