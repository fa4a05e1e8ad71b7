"""Robot to phantom where the touches were surely paired with other landmarks than stated.

Two swapped corners put the tool centimetres off and upside down. The heading of the block, the
points of the tool and the untouched frames cannot be found from there. The reduction of the
measurement therefore uses the pairing that fits the touches. The statement itself is not changed;
the diagnosis judges it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.heading import tool_misfit
from palpate.registration.robot.landmark_pairing import (
    CLEARLY_BETTER,
    IMPOSSIBLE,
    MUCH_BETTER,
    blocked_share,
)
from palpate.registration.robot.robot_fit import RobotFit, fit_robot, similarity
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import PAIRINGS, Touching

__all__ = ["LandmarkRepair", "choose_repair", "find_repairs", "pairings_for", "resized_repair"]

_ALIKE = 5e-4
"""Difference of the RMS up to which pairings fit equally well [m], as a rectangle turned by half a
turn does."""


@dataclass(frozen=True, eq=False)
class LandmarkRepair:
    """Another pairing of the touches.

    Attributes:
        pairing: one of `palpate.setup.setup.PAIRINGS`.
        scale: of the touched polygon over that of the landmarks [1].
        fit: of the touches to the landmarks with this pairing and scale.
        rms_as_stated: RMS of the stated pairing with its best scale [m].
    """

    pairing: str
    scale: float
    fit: RobotFit
    rms_as_stated: float


def pairings_for(count: int) -> tuple[str, ...]:
    """Pairings of `palpate.setup.setup.PAIRINGS` that `count` touches can have, the stated one
    first.
    """
    rows = {
        pairing: [int(word) for word in pairing.split("-")[1:] if word.isdigit()]
        for pairing in PAIRINGS
    }
    return tuple(
        pairing
        for pairing, own in rows.items()
        if max(own, default=0) <= count - pairing.startswith("turn")
    )


def find_repairs(
    touches: FloatArray,
    expected: FloatArray,
    geometry: Geometry | None = None,
    tool_starts: FloatArray | None = None,
) -> tuple[LandmarkRepair, ...]:
    """Find pairings that fit the touches much better than the stated one, best first.

    Args:
        touches: (n, 3) [m], robot frame.
        expected: (n, 3) tool centre at each touch's stated landmark [m], phantom frame.
        geometry: of the phantom.
        tool_starts: (k, 3) positions of the tool before any touch [m], robot frame.
    """
    found = []
    for pairing in pairings_for(len(touches)):
        scale, rms, fit = _fit(touches, expected[Touching(pairing=pairing).order(len(touches))])
        found.append(
            (pairing, scale, fit, rms, blocked_share(tool_starts, geometry, fit.phantom_from_robot))
        )
    stated, lies = found[0][3], found[0][4]
    possible = [row for row in found if row[4] < IMPOSSIBLE or row[4] <= 0.5 * lies]
    best = min((row[3] for row in possible), default=np.inf)
    off = best < MUCH_BETTER * stated and stated - best > CLEARLY_BETTER
    upside_down = lies >= IMPOSSIBLE and best < stated + CLEARLY_BETTER
    if not (off or upside_down):
        return ()
    ranked = sorted(
        (row for row in possible if row[3] < best + _ALIKE and row is not found[0]),
        key=lambda row: row[3],
    )
    return tuple(
        LandmarkRepair(pairing, scale, fit, stated) for pairing, scale, fit, _, _ in ranked
    )


def resized_repair(touches: FloatArray, expected: FloatArray) -> LandmarkRepair:
    """The stated pairing with the polygon's best size; the pose stays, its covariance shrinks."""
    scale, rms, fit = _fit(touches, expected)
    return LandmarkRepair(PAIRINGS[0], scale, fit, rms)


def _fit(touches: FloatArray, places: FloatArray) -> tuple[float, float, RobotFit]:
    """Size of the polygon [1], RMS left [m], and the fit to places (n, 3) [m] of that size."""
    scale, _, rms = similarity(touches, places)
    middle = places.mean(axis=0)
    return scale, rms, fit_robot(touches, middle + scale * (places - middle))


def choose_repair(
    dataset: Dataset, found: Sequence[LandmarkRepair], phantom_from_camera: Transform | None
) -> LandmarkRepair | None:
    """Choose among repairs that fit equally well the one whose tool agrees with the camera.

    Without a frame that shows a tool it is the best fit; None without repairs.
    """
    if not found or phantom_from_camera is None or len(found) == 1:
        return found[0] if found else None
    apart = [
        float(tool_misfit(dataset, one.fit.phantom_from_robot, [phantom_from_camera])[0])
        for one in found
    ]
    return found[int(np.nanargmin(apart))] if np.isfinite(apart).any() else found[0]
