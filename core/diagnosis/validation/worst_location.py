"""Place on the phantom around which most of an error lies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.foundation.arrays import FloatArray

__all__ = ["ErrorLocation", "location_of", "worst_patch_location", "worst_push_location"]


@dataclass(frozen=True)
class ErrorLocation:
    """Place around which most of an error lies.

    Attributes:
        place: phantom frame [m].
        share: of the error within `CRITERIA.verdict.location_radius` [1].
    """

    place: tuple[float, float, float]
    share: float

    def __str__(self) -> str:
        x, y, z = (1e3 * part for part in self.place)
        radius = 1e3 * CRITERIA.verdict.location_radius
        return (
            f"{100 * self.share:.0f} % of it within {radius:.0f} mm of "
            f"({x:.0f}, {y:.0f}, {z:.0f}) mm"
        )


def location_of(centres: FloatArray, total: FloatArray) -> ErrorLocation:
    """Find the place, of places (p, 3) [m], around which most of a total (p,) lies."""
    around = (
        np.linalg.norm(centres[:, None] - centres, axis=2) < CRITERIA.verdict.location_radius
    ) @ total
    worst = int(around.argmax())
    x, y, z = (float(part) for part in centres[worst])
    return ErrorLocation((x, y, z), float(around[worst] / max(total.sum(), 1e-300)))


def worst_push_location(predictions: Sequence[Prediction], evaluator: Evaluator) -> ErrorLocation:
    """Find the push around which most of the squared error of the force lies."""
    total: list[float] = []
    for item in predictions:
        assert item.forces is not None and item.forces.push is not None
        squares = np.nan_to_num(item.forces.gap**2).sum(axis=1)
        total += [
            float(squares[item.forces.push == name].sum()) for name in np.unique(item.forces.push)
        ]
    return location_of(evaluator.problem.pushes[0], np.array(total))


def worst_patch_location(predictions: Sequence[Prediction], evaluator: Evaluator) -> ErrorLocation:
    """Find the patch around which most of the squared residual in contact, without that at rest,
    lies.
    """
    total = np.zeros(evaluator.problem.surface.patches)
    for item in predictions:
        if item.force_only:
            continue
        touched = np.array([frame.in_contact for frame in item.equilibria])
        still = np.isfinite(item.gap) & ~touched[:, None]
        zero = np.where(still, item.gap, 0.0).sum(axis=0) / np.maximum(still.sum(axis=0), 1)
        away = np.where(still.any(axis=0), np.nan_to_num(item.gap - zero), 0.0)
        total += (away**2 * item.count * touched[:, None]).sum(axis=0)
    return location_of(evaluator.problem.surface.patch_centres, total)
