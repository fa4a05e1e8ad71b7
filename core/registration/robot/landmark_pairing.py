"""Detection of touches paired with wrong landmarks, and of a touched polygon of another size.

A finding is proposed to the user, never applied.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.robot.robot_fit import rigid_fits, similarity
from palpate.setup.phantom_geometry import Geometry

__all__ = [
    "CLEARLY_BETTER",
    "IMPOSSIBLE",
    "MUCH_BETTER",
    "TouchProposal",
    "blocked_share",
    "propose_pairing",
]

MUCH_BETTER = 0.5
"""RMS of another pairing over the stated one's, below which it may be proposed [1]."""
CLEARLY_BETTER = 1.0e-3
"""Least reduction of the RMS for a proposal [m]."""
SCALE_SIGMAS, SCALE_LEAST = 3.0, 0.02
"""Least deviation of the size from 1, in standard errors and absolute [1]."""
IMPOSSIBLE = 0.15
"""Share of impossible starts of the tool from which a pairing is rejected [1]."""


@dataclass(frozen=True)
class TouchProposal:
    """A pairing or a size that fits the touches better than stated.

    Attributes:
        pairing: the landmark proposed for each row of touches.csv, in its order.
        scale: size of the touched polygon over that of the landmarks [1]; 1.0 where no other size
            is proposed.
        rms_as_stated: RMS of the touches to their stated landmarks [m].
        rms_proposed: the same with the proposal [m].
        sentence: the finding with its numbers, for a person.
    """

    pairing: tuple[str, ...]
    scale: float
    rms_as_stated: float
    rms_proposed: float
    sentence: str


def propose_pairing(
    names: Sequence[str],
    touches: FloatArray,
    expected: dict[str, FloatArray],
    geometry: Geometry | None = None,
    tool_starts: FloatArray | None = None,
) -> TouchProposal | None:
    """Search for a much better pairing of the touches, then for another size of their polygon.

    Args:
        names: the landmark stated for each touch.
        touches: (n, 3) [m], robot frame.
        expected: tool centre (3,) [m] at each landmark, phantom frame.
        geometry: of the phantom.
        tool_starts: (k, 3) positions of the tool before any touch [m], robot frame. Corners of one
            plane fit equally well upside down; starts inside the phantom or under the table rule
            that out.

    Returns:
        the proposal; None where the statement fits best.
    """
    landmarks = sorted(set(names))
    rows = np.array([landmarks.index(name) for name in names])
    corners = np.array([expected[name] for name in landmarks])
    orders = np.array(list(_orders(len(landmarks))))
    rotations, translations, rms = rigid_fits(touches, corners[orders[:, rows]])
    blocked = np.array(
        [
            blocked_share(tool_starts, geometry, Transform(r, t))
            for r, t in zip(rotations, translations, strict=True)
        ]
    )
    best = _best(orders, rms, blocked)
    pairing = tuple(landmarks[k] for k in orders[best][rows])
    scale, scale_sigma, left = similarity(touches, corners[orders[best][rows]])
    resized = abs(scale - 1) > SCALE_SIGMAS * scale_sigma and abs(scale - 1) > SCALE_LEAST
    if best == 0 and not resized:
        return None
    parts = [_pairing_sentence(names, pairing, rms[0], rms[best], blocked[0])] if best else []
    parts += [_scale_sentence(scale, scale_sigma, rms[best], left, corners)] if resized else []
    return TouchProposal(
        pairing,
        scale if resized else 1.0,
        float(rms[0]),
        left if resized else float(rms[best]),
        " ".join(parts),
    )


def _orders(count: int) -> Iterator[tuple[int, ...]]:
    """Orders of landmarks to try, the stated one first: all permutations up to six landmarks, then
    swaps of two, cyclic shifts, and shifts of the mirrored order.
    """
    stated = tuple(range(count))
    if count <= 6:
        yield from permutations(stated)
        return
    yield stated
    for i, j in combinations(stated, 2):
        swapped = list(stated)
        swapped[i], swapped[j] = j, i
        yield tuple(swapped)
    for shift in range(count):
        if shift:
            yield stated[shift:] + stated[:shift]
        yield stated[::-1][shift:] + stated[::-1][:shift]


def blocked_share(
    tool_starts: FloatArray | None, geometry: Geometry | None, phantom_from_robot: Transform
) -> float:
    """Share of the starts [1] that are impossible: inside the phantom, or under the table."""
    if tool_starts is None or geometry is None or len(tool_starts) == 0:
        return 0.0
    points = phantom_from_robot.apply(tool_starts)
    return float(
        ((geometry.outside(points) < -CLEARLY_BETTER) | (points[:, 2] < -CLEARLY_BETTER)).mean()
    )


def _best(orders: FloatArray, rms: FloatArray, blocked: FloatArray) -> int:
    """Row of the order to propose; 0 unless another is much better, or the stated one impossible.

    An equal fit is no reason: a rectangle turned by half a turn fits as well. Among equal fits the
    one with fewest changes wins.
    """
    candidates = blocked <= (blocked[0] if blocked[0] < IMPOSSIBLE else 0.5 * blocked[0])
    if not candidates.any():
        return 0
    lowest = rms[candidates].min()
    better = lowest < MUCH_BETTER * rms[0] and rms[0] - lowest > CLEARLY_BETTER
    upside_down = blocked[0] >= IMPOSSIBLE and lowest < rms[0] + CLEARLY_BETTER
    if not (better or upside_down):
        return 0
    equals = candidates & (rms < lowest + 0.2 * max(lowest, CLEARLY_BETTER))
    changed = (orders != orders[0]).sum(axis=1)
    ranked = np.lexsort((rms, np.where(equals, changed, len(orders[0]) + 1)))
    return int(ranked[0])


def _pairing_sentence(
    stated: Sequence[str], pairing: Sequence[str], before: float, after: float, blocked: float
) -> str:
    changes = [
        f"row {row + 1} {old} -> {new}"
        for row, (old, new) in enumerate(zip(stated, pairing, strict=True))
        if old != new
    ]
    fit = (
        f"RMS {before * 1e3:.1f} mm as stated, {after * 1e3:.1f} mm "
        f"({after / before - 1:+.0%}) with {', '.join(changes)}."
    )
    why = (
        " As stated, the tool would be inside the phantom or under the table at the start of "
        f"{blocked:.0%} of the sequences."
        if blocked >= IMPOSSIBLE
        else ""
    )
    return (
        f"The touches seem to be paired with the wrong landmarks: {fit}{why} Correct the "
        "landmark names in touches.csv if so."
    )


def _scale_sentence(
    scale: float, sigma: float, before: float, after: float, corners: FloatArray
) -> str:
    reach = float(np.sqrt(((corners - corners.mean(axis=0)) ** 2).sum(axis=1).mean()))
    size, side = ("smaller", "inside") if scale < 1 else ("larger", "outside")
    return (
        f"The touched polygon is {abs(scale - 1):.1%} (+- {sigma:.1%}) {size} than the landmarks, "
        "each touch about "
        f"{abs(scale - 1) * reach * 1e3:.1f} mm {side} its landmark: with that size the RMS falls "
        f"from {before * 1e3:.1f} to "
        f"{after * 1e3:.1f} mm. Check where the landmarks were touched, the tip's offset and the "
        "phantom's size."
    )
