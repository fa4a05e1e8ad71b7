"""The two pictures that convince: the measured error pattern, and the pattern that the named cause predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from core.diagnosis.bench import Bench
from core.diagnosis.gain import fixed_pattern
from core.diagnosis.hypothesis import Model
from core.diagnosis.observations import Observations
from core.errors import DiagnosisError
from core.frames import FloatArray
from core.measurement import SIDES, Surface

__all__ = ["Patterns", "draw_patterns", "patterns"]

_SMOOTHING = 3.5e-3
_LEAST_POINTS = 5


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


def patterns(bench: Bench, data: Sequence[Observations], baseline: Model, found: Model) -> Patterns:
    """The error of the one push in which the cause matters most, smoothed alike, without the camera's own pattern."""
    best: tuple[float, FloatArray, FloatArray, FloatArray] | None = None
    for item, before, after in zip(data, baseline.predictions, found.predictions, strict=True):
        zero, known = fixed_pattern(item, after)
        seen = np.isfinite(before.gap) & np.isfinite(after.gap) & (known >= _LEAST_POINTS)
        points = np.where(seen, before.count, 0.0)
        change, error = (np.where(seen, gap, 0.0) for gap in (before.gap - after.gap, before.gap - zero))
        touched = np.array([0 if group.free else 1 + group.probe for group in item.groups])
        for probe in np.unique(touched[touched > 0]):
            rows = points * (touched == probe)[:, None]
            weight, size = rows.sum(axis=0), float((change**2 * rows).sum())
            if best is None or size > best[0]:
                best = (size, (rows * error).sum(axis=0), (rows * change).sum(axis=0), weight)
    if best is None:
        raise DiagnosisError("the tool touches the phantom in no sequence that was fitted on")
    _, error_sum, change_sum, weight = best
    near = _kernel(bench.surface)
    total = near @ weight
    shown = np.where((total >= _LEAST_POINTS) & (weight > 0), total, np.nan)
    return Patterns(
        bench.surface.patch_centres, bench.surface.patch_normals, (near @ error_sum) / shown, (near @ change_sum) / shown
    )  # fmt: skip


def _kernel(surface: Surface) -> FloatArray:
    """Gaussian weights (p, p) between patches of one side."""
    centres, normals = surface.patch_centres, surface.patch_normals
    distance = np.linalg.norm(centres[:, None] - centres, axis=2)
    return np.asarray(np.exp(-0.5 * (distance / _SMOOTHING) ** 2) * (normals @ normals.T > 0.5))


def draw_patterns(found: Patterns, surface: Surface, path: Path) -> None:
    """Both patterns on the unfolded block, one colour scale in mm, as PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    sizes = np.abs(np.concatenate([found.measured, found.predicted]))
    seen = sizes[np.isfinite(sizes)]
    limit = max(1e3 * float(np.quantile(seen, 0.98)), 0.05) if len(seen) else 1.0
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
