"""Robot to phantom where the touches were surely paired with other landmarks than stated.

Two corners taken for each other put the tool centimetres off and upside down. Nothing that looks at
the tool in the clouds can work from there: which way round the block lies, which points are of the
tool, which frames are untouched. So what reduces the measurement looks from the pairing that the
touches themselves ask for. What was stated stays as it is: it is for the diagnosis to weigh it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.heading import tool_misfit
from palpate.registration.landmark_pairing import (
    CLEARLY_BETTER,
    IMPOSSIBLE,
    MUCH_BETTER,
    blocked_share,
)
from palpate.registration.robot_fit import RobotFit, fit_robot, similarity
from palpate.setup.setup import PAIRINGS, Touching

__all__ = ["Repair", "pairings_for", "repairs", "resized", "settled"]

_ALIKE = 5e-4
"""RMS [m] by which a pairing may fit worse than the best and still be meant: a rectangle turned by
half a turn fits as well."""


@dataclass(frozen=True, eq=False)
class Repair:
    """Another pairing of the touches.

    Attributes:
        pairing: one of `palpate.setup.setup.PAIRINGS`.
        scale: of the touched polygon over that of the landmarks [1].
        fit: of the touches to the landmarks so paired and scaled.
        rms_as_stated: the same as they are stated, with the size that then fits best [m].
    """

    pairing: str
    scale: float
    fit: RobotFit
    rms_as_stated: float


def pairings_for(count: int) -> tuple[str, ...]:
    """Those of `palpate.setup.setup.PAIRINGS` that so many touches can have, the stated one
    first."""
    rows = {
        pairing: [int(word) for word in pairing.split("-")[1:] if word.isdigit()]
        for pairing in PAIRINGS
    }
    return tuple(
        pairing
        for pairing, own in rows.items()
        if max(own, default=0) <= count - pairing.startswith("turn")
    )


def repairs(
    touches: FloatArray,
    expected: FloatArray,
    size: tuple[float, float, float] | None = None,
    tool_starts: FloatArray | None = None,
) -> tuple[Repair, ...]:
    """Other pairings of touches (n, 3) [m], robot frame, that fit them much better than as stated,
    best first.

    Args:
        expected: (n, 3) tool centre [m] at each touch's stated landmark, phantom frame.
        size: of the phantom [m].
        tool_starts: (k, 3) [m] where the tool was before it touched anything, robot frame.
    """
    found = []
    for pairing in pairings_for(len(touches)):
        scale, rms, fit = _fit(touches, expected[Touching(pairing=pairing).order(len(touches))])
        found.append(
            (pairing, scale, fit, rms, blocked_share(tool_starts, size, fit.phantom_from_robot))
        )
    stated, lies = found[0][3], found[0][4]
    possible = [row for row in found if row[4] < IMPOSSIBLE or row[4] <= 0.5 * lies]
    best = min((row[3] for row in possible), default=np.inf)
    off = best < MUCH_BETTER * stated and stated - best > CLEARLY_BETTER
    upside_down = lies >= IMPOSSIBLE and best < stated + CLEARLY_BETTER
    if not (off or upside_down):
        return ()
    kept = sorted(
        (row for row in possible if row[3] < best + _ALIKE and row is not found[0]),
        key=lambda row: row[3],
    )
    return tuple(Repair(pairing, scale, fit, stated) for pairing, scale, fit, _, _ in kept)


def resized(touches: FloatArray, expected: FloatArray) -> Repair:
    """The stated pairing with the polygon's best size: the pose stays, but touches that agree so
    well say more of it.
    """
    scale, rms, fit = _fit(touches, expected)
    return Repair(PAIRINGS[0], scale, fit, rms)


def _fit(touches: FloatArray, places: FloatArray) -> tuple[float, float, RobotFit]:
    """Size of the polygon [1], RMS that it leaves [m], and the fit to places (n, 3) [m] of that
    size.
    """
    scale, _, rms = similarity(touches, places)
    middle = places.mean(axis=0)
    return scale, rms, fit_robot(touches, middle + scale * (places - middle))


def settled(
    dataset: Dataset, found: Sequence[Repair], phantom_from_camera: Transform | None
) -> Repair | None:
    """Of repairs that fit alike the one that puts the tool where the camera sees it; the best fit
    where no frame shows a tool.
    """
    if not found or phantom_from_camera is None or len(found) == 1:
        return found[0] if found else None
    apart = [
        float(tool_misfit(dataset, one.fit.phantom_from_robot, [phantom_from_camera])[0])
        for one in found
    ]
    return found[int(np.nanargmin(apart))] if np.isfinite(apart).any() else found[0]
