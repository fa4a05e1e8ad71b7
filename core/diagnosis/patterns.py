"""The two pictures that convince: the measured error pattern, and the pattern that the named cause predicts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from core.diagnosis.models import Bench, Model
from core.frames import FloatArray
from core.measurement import SIDES, Surface

__all__ = ["Patterns", "draw_patterns", "patterns"]

_DEEPEST = 0.35
_LEAST_POINTS = 8


@dataclass(frozen=True, eq=False)
class Patterns:
    """Error by patch (p,) [m], NaN where unseen: measured minus stated model, and extended minus stated model."""

    centres: FloatArray
    normals: FloatArray
    measured: FloatArray
    predicted: FloatArray

    def save(self, path: Path) -> None:
        """Write as npz."""
        np.savez_compressed(path, centres=self.centres, normals=self.normals, measured=self.measured, predicted=self.predicted)


def patterns(bench: Bench, baseline: Model, found: Model) -> Patterns:
    """Averages over the frames in which the cause matters most; the untouched frames are taken off (the camera's own pattern)."""
    count = bench.surface.patches
    measured, predicted, weight = np.zeros(count), np.zeros(count), np.zeros(count)
    for before, after in zip(baseline.predictions, found.predictions, strict=True):
        seen = np.isfinite(before.gap) & np.isfinite(after.gap)
        points = np.where(seen, before.count, 0.0)
        change = np.where(seen, before.gap - after.gap, 0.0)
        size = np.sqrt((change**2 * points).sum(axis=1) / np.maximum(points.sum(axis=1), 1))
        # The first group is the rest cloud, as the camera was registered: the zero to which errors are counted.
        zero, zero_seen = np.where(seen[0], before.gap[0], 0.0), seen[0]
        used = size >= np.quantile(size, 1 - _DEEPEST) if size.max() > 0 else np.array([f.in_contact for f in before.equilibria])
        used[0] = False
        rows = points * used[:, None] * zero_seen
        measured += (rows * (np.where(seen, before.gap, 0.0) - zero)).sum(axis=0)
        predicted += (rows * change).sum(axis=0)
        weight += rows.sum(axis=0)
    enough = weight >= _LEAST_POINTS
    safe = np.where(enough, weight, 1.0)
    return Patterns(
        bench.surface.patch_centres, bench.surface.patch_normals,
        np.where(enough, measured / safe, np.nan), np.where(enough, predicted / safe, np.nan),
    )  # fmt: skip


def draw_patterns(found: Patterns, surface: Surface, path: Path) -> None:
    """Both patterns on the unfolded block, one colour scale in mm, as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    limit = max(1e3 * float(np.nanquantile(np.abs(np.concatenate([found.measured, found.predicted])), 0.98)), 0.05)
    for number, (title, values) in enumerate((("measured error", found.measured), ("predicted by the cause", found.predicted))):
        axes = figure.add_subplot(1, 2, number + 1)
        drawn = _unfold(axes, found, values * 1e3, surface, limit)
        axes.set_title(title)
        axes.set_aspect("equal")
        axes.axis("off")
    figure.colorbar(drawn, ax=figure.axes, shrink=0.7, label="surface higher (+) or lower (-) than the simulation [mm]")
    figure.savefig(path, dpi=130)


def _unfold(axes: Any, found: Patterns, values: FloatArray, surface: Surface, limit: float) -> Any:
    """Scatter the patches of the top and, folded out around it, of the four sides."""
    x, y, z = surface.geometry.size
    centres, normals = found.centres, found.normals
    place = centres[:, :2].copy()
    for side in SIDES[1:]:
        axis, sign = "xy".index(side[1]), 1.0 if side[0] == "+" else -1.0
        here = normals[:, axis] == sign
        place[here, axis] = sign * ((x, y)[axis] / 2 + 1e-3 + z - centres[here, 2])
    seen = np.isfinite(values)
    size = (surface.patch * 1e3 * 1.55) ** 2
    axes.scatter(*(1e3 * place[~seen]).T, s=size, c="0.93", marker="s", linewidths=0)
    return axes.scatter(
        *(1e3 * place[seen]).T, s=size, c=values[seen], cmap="RdBu_r", vmin=-limit, vmax=limit, marker="s", linewidths=0
    )
