"""Patterns of the measured error and of the error that the named causes predict, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.gain.probe_errors import fixed_pattern
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError
from palpate.foundation.figure import new_figure, save_figure
from palpate.setup.phantom_geometry import PATCH, Surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ErrorPatterns", "draw_patterns", "error_patterns", "patterns_figure"]


@dataclass(frozen=True, eq=False)
class ErrorPatterns:
    """Error patterns over p surface patches.

    Attributes:
        centres: (p, 3) of the patches, phantom frame [m].
        normals: (p, 3) outwards.
        measured: (p,) measured minus stated model [m]; NaN without points.
        predicted: (p,) extended minus stated model [m]; NaN without points.
    """

    centres: FloatArray
    normals: FloatArray
    measured: FloatArray
    predicted: FloatArray

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote."""
        with np.load(path) as arrays:
            return cls(**{name: arrays[name] for name in arrays.files})

    def save(self, path: Path) -> None:
        """Write as npz."""
        np.savez_compressed(
            path,
            centres=self.centres,
            normals=self.normals,
            measured=self.measured,
            predicted=self.predicted,
        )


def error_patterns(
    evaluator: Evaluator, data: Sequence[Observations], baseline: Model, extended: Model
) -> ErrorPatterns:
    """Compute the error of one push and the causes' prediction of it, with the same smoothing.

    It is the push that the causes change most; if no cause is named, the push with the largest
    error. The camera's fixed pattern is subtracted, unless the causes change the untouched phantom
    more than the push (sag, a moved camera).

    Raises DiagnosisError if the tool touches the phantom in no fitted sequence.
    """
    pairs = [
        row
        for row in zip(data, baseline.predictions, extended.predictions, strict=True)
        if not row[0].force_only
    ]
    lasting = extended.setup.pushes_leave_traces
    compared = [
        _compare(item, before, after, whole=False, lasting=lasting) for item, before, after in pairs
    ]
    if sum(still for _, still, _ in compared) > sum(
        (rows.change**2 * rows.points).sum() for _, _, rows in compared
    ):
        compared = [
            _compare(item, before, after, whole=True, lasting=lasting)
            for item, before, after in pairs
        ]
    unnamed = not any(rows.change.any() for _, _, rows in compared)
    best: tuple[float, _Rows] | None = None
    for touched, _, rows in compared:
        for push in np.unique(touched[touched > 0]):
            points = rows.points * (touched == push)[:, None]
            size = float(((rows.error if unnamed else rows.change) ** 2 * points).sum())
            if best is None or size > best[0]:
                best = (size, _Rows(points, rows.error, rows.change))
    if best is None:
        raise DiagnosisError("the tool touches the phantom in no sequence that was fitted on")
    points, error, change = best[1].points, best[1].error, best[1].change
    near, weight = _kernel(evaluator.problem.surface), points.sum(axis=0)
    total = near @ weight
    shown = np.where((total >= CRITERIA.figures.least_points) & (weight > 0), total, np.nan)
    measured, predicted = (
        near @ (points * values).sum(axis=0) / shown for values in (error, change)
    )
    return ErrorPatterns(
        evaluator.problem.surface.patch_centres,
        evaluator.problem.surface.patch_normals,
        measured,
        predicted,
    )


@dataclass(frozen=True, eq=False)
class _Rows:
    """One sequence by group and patch, (g, p) each; zero without points.

    Attributes:
        points: number of points.
        error: of the stated model [m].
        change: by the causes [m].
    """

    points: FloatArray
    error: FloatArray
    change: FloatArray


def _compare(
    item: Observations, before: Prediction, after: Prediction, *, whole: bool, lasting: bool
) -> tuple[FloatArray, float, _Rows]:
    """Compare both models with one sequence.

    Args:
        item: the sequence.
        before: its prediction by the stated model.
        after: its prediction by the extended model.
        whole: whether to keep the camera's fixed pattern.
        lasting: whether groups after a push count as its own, because it leaves a mark.

    Returns the number of the push plus one of each touched group (g,), else 0; the squared change
    of untouched frames; and the errors of the touched groups.
    """
    (own, known), other = (
        fixed_pattern(item, before, lasting),
        fixed_pattern(item, after, lasting)[0],
    )
    seen = (
        np.isfinite(before.gap) & np.isfinite(after.gap) & (known >= CRITERIA.figures.least_points)
    )
    counts = [not group.free or (lasting and group.push > 0) for group in item.groups]
    touched = np.array(
        [1 + group.push if one else 0 for group, one in zip(item.groups, counts, strict=True)]
    )
    points = np.where(seen & (touched > 0)[:, None], before.count, 0.0)
    still = np.where(known >= CRITERIA.figures.least_points, own - other, 0.0)
    error, change = np.where(seen, before.gap, 0.0), np.where(seen, before.gap - after.gap, 0.0)
    if not whole:
        error, change = error - np.where(seen, own, 0.0), change - np.where(seen, still, 0.0)
    return touched, float((still**2 * points).sum()), _Rows(points, error, change)


def _kernel(surface: Surface) -> FloatArray:
    """Gaussian weights (p, p) between patches of one side."""
    centres, normals = surface.patch_centres, surface.patch_normals
    distance = np.linalg.norm(centres[:, None] - centres, axis=2)
    return np.asarray(
        np.exp(-0.5 * (distance / CRITERIA.figures.pattern_smoothing) ** 2)
        * (normals @ normals.T > 0.5)
    )


def draw_patterns(patterns: ErrorPatterns, path: Path) -> None:
    """Write the figure of both patterns as PNG."""
    save_figure(patterns_figure(patterns), path)


def patterns_figure(patterns: ErrorPatterns) -> Figure:
    """Draw both patterns, or the error alone if no cause is named, on the unfolded surface.

    Both have one colour scale [mm].
    """
    shown = [("measured error", patterns.measured), ("predicted by the cause", patterns.predicted)]
    shown = shown if np.nan_to_num(patterns.predicted).any() else shown[:1]
    figure = new_figure(1.4 + 4.3 * len(shown), 4.6)
    sizes = np.abs(np.concatenate([patterns.measured, patterns.predicted]))
    seen = sizes[np.isfinite(sizes)]
    limit = max(1e3 * float(np.quantile(seen, 0.98)), 0.05) if len(seen) else 1.0
    for number, (title, values) in enumerate(shown):
        axes = figure.add_subplot(1, len(shown), number + 1)
        drawn = _drawn(axes, patterns, values * 1e3, limit)
        axes.set_title(title)
        axes.set_aspect("equal")
        axes.axis("off")
    figure.colorbar(
        drawn,
        ax=figure.axes,
        shrink=0.7,
        label="surface higher (+) or lower (-) than the simulation [mm]",
    )
    return figure


def _drawn(axes: Any, patterns: ErrorPatterns, values: FloatArray, limit: float) -> Any:
    """Scatter the patches of the unfolded surface."""
    place = _unfolded(patterns)
    seen = np.isfinite(values)
    size = (PATCH * 1e3 * 1.55) ** 2
    axes.scatter(*(1e3 * place[~seen]).T, s=size, c="0.93", marker="s", linewidths=0)
    return axes.scatter(
        *(1e3 * place[seen]).T,
        s=size,
        c=values[seen],
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        marker="s",
        linewidths=0,
    )


def _unfolded(patterns: ErrorPatterns) -> FloatArray:
    """Places (p, 2) [m] of the patches from above, the upright ones folded outwards."""
    centres, normals = patterns.centres, patterns.normals
    below = centres[:, 2].max() - centres[:, 2] + CRITERIA.figures.fold
    level = np.linalg.norm(normals[:, :2], axis=1, keepdims=True)
    return np.asarray(centres[:, :2] + normals[:, :2] * level * below[:, None])
