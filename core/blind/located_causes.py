"""Places of inclusions and lines of tubes: how far those found lie from the true ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from palpate.blind.case_results import CaseResult
from palpate.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from palpate.setup.setup import Box, Shape
    from palpate.synthetic import HiddenEffect

__all__ = [
    "NEAR",
    "centre_error",
    "centre_errors",
    "line_share",
    "line_shares",
    "same_way",
    "true_line",
]

NEAR = 3e-3
"""Distance up to which a place or a piece of a line counts as found [m]."""
_TURNED = ("aside", "inclination", "bend")
"""Parameters of a tube that change their sign with the way along it."""
_STEP = 0.5e-3
"""Distance of the points at which lines are compared [m]."""
_TOLD = 33
"""Points of a true line in a row of results."""


def centre_error(result: CaseResult) -> float | None:
    """Distance of the inclusion's reported centre from the true one [m]; None where none is hidden
    or named.
    """
    hidden, cause = _pair(result, "stiff_inclusion")
    if hidden is None or cause is None:
        return None
    found, true = (
        np.array([float(one["parameters"][axis]["value"]) for axis in "xyz"])
        for one in (cause, hidden)
    )
    return float(np.linalg.norm(found - true))


def line_share(result: CaseResult) -> float | None:
    """Share of the tube's length [1] over which its reported and its true line are within `NEAR` of
    each other; None where none is hidden or named.

    It is the smaller one of the shares of the two lines, so that neither a short piece nor one that
    goes on elsewhere counts as the whole tube.
    """
    hidden, cause = _pair(result, "stiff_tube")
    if hidden is None or cause is None:
        return None
    found, true = (_sampled(one.get("polyline") or []) for one in (cause, hidden))
    if not len(found) or not len(true):
        return 0.0
    return min(_share(found, true), _share(true, found))


def centre_errors(results: Iterable[CaseResult]) -> list[float]:
    """Errors [m] of all inclusions that are hidden and named."""
    return [error for one in results if (error := centre_error(one)) is not None]


def line_shares(results: Iterable[CaseResult]) -> list[float]:
    """Shares [1] of all tubes that are hidden and named."""
    return [share for one in results if (share := line_share(one)) is not None]


def true_line(tube: HiddenEffect, body: Box | Shape) -> list[list[float]]:
    """Points (k, 3) [m] of a hidden tube's axis from surface to surface: its longest stretch inside
    the body.

    Args:
        tube: hidden.
        body: as it is on the bench.
    """
    from palpate.synthetic.laws.stiffness_fields import tube_axis

    end = float(np.linalg.norm(body.high - body.low)) / 2
    points = tube_axis(tube, (body.low + body.high)[:2] / 2, np.arange(-end, end, _STEP))
    inside = np.concatenate([[0], (body.outside(points) < 0).astype(int), [0]])
    ends = np.flatnonzero(np.diff(inside)).reshape(-1, 2)
    if not len(ends):
        return []
    first, last = max(ends.tolist(), key=lambda stretch: stretch[1] - stretch[0])
    told = points[np.unique(np.linspace(first, last - 1, _TOLD).round().astype(int))]
    return [[round(value, 5) for value in point] for point in told.tolist()]


def same_way(
    true: Mapping[str, dict[str, Any]], found: Mapping[str, dict[str, Any]]
) -> Mapping[str, dict[str, Any]]:
    """True parameters of an effect, those of a tube along the way that the found ones go: a tube is
    the same one from either end.
    """
    if "heading" not in true or "heading" not in found:
        return true
    heading = float(true["heading"]["value"])
    if np.cos(heading - float(found["heading"]["value"])) >= 0.0:
        return true
    other = {name: {**true[name], "value": -true[name]["value"]} for name in _TURNED}
    return {**true, **other, "heading": {**true["heading"], "value": heading + np.pi}}


def _pair(result: CaseResult, effect: str) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """The hidden effect of this name and the cause that names it."""
    hidden = next((one for one in result.hidden if one["effect"] == effect), None)
    return hidden, next((one for one in result.causes if one["effect"] == effect), None)


def _sampled(line: Sequence[Sequence[float]]) -> FloatArray:
    """Points (k, 3) [m] of a polyline at even distances of about `_STEP`."""
    points = np.array(line, dtype=float).reshape(-1, 3)
    if len(points) < 2:
        return points
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, way[-1], int(np.ceil(way[-1] / _STEP)) + 1)
    return np.column_stack([np.interp(at, way, points[:, axis]) for axis in range(3)])


def _share(line: FloatArray, other: FloatArray) -> float:
    """Share [1] of the points of a line that are near another one."""
    return float(np.mean(cKDTree(other).query(line)[0] <= NEAR + _STEP / 100))
