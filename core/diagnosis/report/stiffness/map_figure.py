"""Figure of a free map of the stiffness: the surface from above and from the sides, in colours of
what lies below it, grey where the data do not tell.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import KDTree

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.report.palpation_figure import FAINT, INK
from palpate.diagnosis.report.stiffness.map_report import unusual_parts
from palpate.diagnosis.report.stiffness.stiffness_map import StiffnessMap
from palpate.foundation.arrays import FloatArray
from palpate.foundation.figure import new_figure, save_figure
from palpate.setup.phantom_geometry import Geometry

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_map", "finely_divided"]

_VIEWS = {
    "from above": (np.array([0.0, 0.0, 1.0]), (0, 1)),
    "from -y": (np.array([0.0, -1.0, 0.0]), (0, 2)),
    "from +x": (np.array([1.0, 0.0, 0.0]), (1, 2)),
}
"""Direction to the eye, and the axes along which a view lies."""


def draw_map(path: Path, body: Geometry, made: StiffnessMap) -> None:
    """Draw a map as PNG; pushes are rings, and dots with their numbers where they carry a part.

    Args:
        path: of the file.
        body: the phantom.
        made: the map.
    """
    values = made.on_surface
    ratio = values.ends[0]
    shown = np.where(values.trusted, np.log(ratio), np.nan)
    limit = max(
        float(np.abs(shown[values.trusted]).max(initial=0.0)),
        CRITERIA.figures.least_stiffness_change,
    )
    vertices, triangles = finely_divided(*body.closed_surface, made.cells.spacing / 6)
    nearest = KDTree(values.places).query(vertices[triangles].mean(axis=1))[1]
    figure = new_figure(12.6, 4.6)
    drawn: Any = None
    for axes, (name, (eye, flat)) in zip(figure.subplots(1, 3), _VIEWS.items(), strict=True):
        drawn = _view(axes, vertices, triangles, shown[nearest], limit, eye, flat)
        _dots(axes, made, eye, flat)
        axes.set_title(name, fontsize=11, loc="left")
        axes.set(xlabel=f"{'xyz'[flat[0]]} [mm]", ylabel=f"{'xyz'[flat[1]]} [mm]", aspect="equal")
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=9, colors=INK)
    bar = figure.colorbar(drawn, ax=figure.axes, location="bottom", shrink=0.5, aspect=40, pad=0.02)
    ticks = np.linspace(-limit, limit, 5)
    bar.set_ticks(ticks.tolist(), labels=[f"{np.exp(one):.2f}" for one in ticks])
    bar.set_label(
        "stiffness over the usual one of this body; grey: the data do not tell", fontsize=9
    )
    save_figure(figure, path)


def _view(
    axes: Axes,
    vertices: FloatArray,
    triangles: Any,
    values: FloatArray,
    limit: float,
    eye: FloatArray,
    flat: tuple[int, int],
) -> Any:
    """Draw the triangles that face the eye; return what the colours belong to."""
    from matplotlib import colormaps
    from matplotlib.collections import PolyCollection

    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero(
        normals @ eye > CRITERIA.figures.facing * np.linalg.norm(normals, axis=1)
    )
    order = facing[np.argsort(corners[facing].mean(axis=1) @ eye)]
    drawn = PolyCollection(
        1e3 * corners[order][:, :, list(flat)],
        array=np.ma.masked_invalid(values[order]),
        cmap=colormaps["RdBu_r"].with_extremes(bad=FAINT),
        linewidths=0.0,
        antialiased=False,
    )
    drawn.set_clim(-limit, limit)
    axes.add_collection(drawn)
    axes.autoscale_view()
    return drawn


def _dots(axes: Axes, made: StiffnessMap, eye: FloatArray, flat: tuple[int, int]) -> None:
    """Draw the pushes from the eye's side, and the numbers of those that carry a part."""
    carriers = {number for part in unusual_parts(made) for number in part["pushes"]}
    for push in made.pushes:
        if push.normal @ eye < CRITERIA.figures.pushed_from:
            continue
        x, y = 1e3 * push.place[list(flat)]
        axes.plot(
            x, y, "o", ms=4, color=INK if push.number in carriers else "none", mec=INK, mew=0.8
        )
        if push.number in carriers:
            axes.annotate(
                str(push.number), (x, y), xytext=(4, 3), textcoords="offset points", fontsize=8
            )


def finely_divided(vertices: FloatArray, triangles: Any, edge: float) -> tuple[FloatArray, Any]:
    """Cut triangles in halves at their longest edges until no edge is longer than `edge` [m].

    Returns vertices (v, 3) [m], of which neighbours may have copies, and triangles (t, 3).
    """
    corners = vertices[triangles]
    while True:
        lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = lengths.max(axis=1) > edge
        if not long.any():
            return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
        turned = (lengths[long].argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners[long], turned[..., None], axis=1), 1, 0)
        middle = (a + b) / 2
        halves = [np.stack(part, axis=1) for part in ((a, middle, c), (middle, b, c))]
        corners = np.concatenate([corners[~long], *halves])
