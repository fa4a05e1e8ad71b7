"""What the virtual block cannot go through, or only against a pressure: the ball, its shaft, the
table, a body beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.mooney_rivlin import spread
from palpate.synthetic.solver.tet_block import Block, Sampling

__all__ = ["SOFT_GAP", "Neighbour", "Obstacle", "Shaft", "assemble_obstacle", "shaft_radius"]

SOFT_GAP = 0.03e-3
CAUTIOUS_GAP = 0.02
_FAST = {"contract", "reassoc", "arcp", "nsz"}


def shaft_radius(ball: float) -> float:
    """Of the rod on which a ball of this radius sits [m]."""
    return min(3e-3, 0.8 * ball)


@dataclass(frozen=True)
class Shaft:
    """A rod that the ball sits on: `away` (3,) unit vector from the ball along it, its `radius` and
    `length` [m].
    """

    away: FloatArray
    radius: float
    length: float


@dataclass(frozen=True)
class Obstacle:
    """One of them.

    Attributes:
        sampling: the points on which it acts.
        centre: of a ball, where a shaft begins, or on a plane (3,) [m].
        along: (3,) the way of the shaft [m], zero for a ball; normal of a plane, towards the block.
        radius: [m]; 0 for a plane.
        penalty: pressure per depth [Pa/m].
        of_tool: whether its push is the tool's.
    """

    sampling: Sampling
    centre: FloatArray
    along: FloatArray
    radius: float
    penalty: float
    of_tool: bool


@dataclass(frozen=True)
class Neighbour:
    """A soft body that lies against a face of the block, and gives way like a bed of springs
    without friction.

    Attributes:
        axis: of the face's normal.
        sign: of its side.
        overlap: how far it would stand in the block [m].
        stiffness: pressure per way that it is pushed back [Pa/m].
    """

    axis: int
    sign: float
    overlap: float
    stiffness: float

    def against(self, block: Block) -> Obstacle:
        """It, pressing on the points of that face."""
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
    """How deep a point x (3,) is in it [m], its distance from centre or axis [m], and whether it is
    beside the shaft's length.

    Fills the normal n (3,) where it is in it.
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
    push: Any,
    coupling: Any,
    total: Any,
) -> tuple[float, float]:
    """An `Obstacle` pressing on surface points; frictionless penalty [Pa/m].

    The pressure sets in quadratically over SOFT_GAP: a kink there makes Newton jump between sets of
    touching points.

    Where the pressure turns as the block slides along a sphere, the stiffness can be negative; a
    `cautious` one leaves that part out where the pressure is high.

    Adds to element stiffness, nodal force, push (3,) the force on the block [N], coupling (n, 3, 3)
    = -d force / d centre, and total (3, 3) its sum, where `derivative`; returns energy [J] and
    deepest penetration [m].
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
            straight = (
                bend / (reach * reach) if beside else 0.0
            )  # along its axis a shaft does not turn the pressure
            for i in range(3):
                pull[i] = -pressure * n[i]
                push[i] -= pull[i]
                for k in range(3):
                    t[i, k] = (
                        (slope + bend) * n[i] * n[k]
                        - (bend if i == k else 0.0)
                        + straight * along[i] * along[k]
                    )
                    total[i, k] += t[i, k]
            spread(values[s, q], element, pull, t, stiffness[owner[s]], force, coupling)
    return energy, deepest
