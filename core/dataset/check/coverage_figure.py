"""Figure of the tool's paths on the phantom: three views at one scale, coloured by depth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.dataset.folder import Dataset
from palpate.dataset.tool_motion import describe_motion, smooth_path
from palpate.foundation.arrays import FloatArray
from palpate.foundation.figure import new_figure, save_figure
from palpate.foundation.frames import Transform

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure

__all__ = ["coverage_picture"]

_INK, _FAINT, _BOX, _LANDMARK = "#30363d", "#c4c9cf", "#eef0f2", "#b3261e"
_DEPTHS = ("#f2b134", "#d9602b", "#8f1d5c", "#1f0f3d")
_MARGIN = 14.0
"""Margin around the box [mm]."""
_VIEWS = {"top": (0, 1), "front": (0, 2), "right": (1, 2)}
_TITLES = {"top": "from above", "front": "from the front", "right": "from the right"}
_MOST_LISTED = 14


def coverage_picture(dataset: Dataset, phantom_from_robot: Transform, path: Path) -> None:
    """Write the figure as PNG to `path`, atomically."""
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    paths = {
        name: smooth_path(dataset.sequence(name), phantom_from_robot)[1]
        for name in dataset.sequences
    }
    depths = {
        name: -1e3 * dataset.geometry.gap(points, dataset.config.tool_radius)
        for name, points in paths.items()
    }
    colours = LinearSegmentedColormap.from_list("depth", _DEPTHS)
    norm = Normalize(0.0, max(1.0, *(float(depth.max()) for depth in depths.values())))
    figure, axes = _figure(dataset)
    for view in _VIEWS:
        _draw_phantom(axes[view], dataset, view)
        for name, points in paths.items():
            _draw_path(axes[view], 1e3 * points[:, _VIEWS[view]], depths[name], colours, norm)
    motions = [
        describe_motion(dataset, dataset.sequence(name), phantom_from_robot)
        for name in dataset.sequences
    ]
    _number_places(
        axes["top"],
        {
            i: 1e3 * np.array(motion.contacts[0].place)
            for i, motion in enumerate(motions, 1)
            if motion.contacts
        },
    )
    _draw_legend(axes["legend"], dataset, colours, norm)
    save_figure(figure, path)


def _figure(dataset: Dataset) -> tuple[Figure, dict[str, Axes]]:
    """Figure and axes, placed so that all views have one scale and the upper one is above the lower
    one.
    """
    x, y, z = (1e3 * length for length in dataset.config.size)
    left, right, upper, lower = (
        x + 2 * _MARGIN,
        max(y + 2 * _MARGIN, 45.0),
        y + 2 * _MARGIN,
        z + _MARGIN + 2,
    )
    scale = 8.4 / (left + right)  # inches per mm
    width, height = scale * (left + right) + 2.0, scale * (upper + lower) + 2.3
    figure = new_figure(width, height, layout=None, facecolor="white")

    def axes(across: float, up: float, wide: float, high: float) -> Axes:
        return figure.add_axes(
            (across / width, up / height, scale * wide / width, scale * high / height)
        )

    second, above = 0.8 + scale * left + 0.9, 0.6 + scale * lower + 0.85
    figure.text(
        0.25 / width,
        1 - 0.32 / height,
        f"{dataset.name}: paths of the tool's centre",
        color=_INK,
        fontsize=14,
        va="center",
    )
    return figure, {
        "top": axes(0.8, above, left, upper),
        "front": axes(0.8, 0.6, left, lower),
        "right": axes(second, 0.6, y + 2 * _MARGIN, lower),
        "legend": axes(second, above, right, upper),
    }


def _draw_legend(axis: Axes, dataset: Dataset, colours: Colormap, norm: Normalize) -> None:
    from matplotlib.cm import ScalarMappable

    names = [f"{index}  {name}" for index, name in enumerate(dataset.sequences, 1)]
    shown = (
        names
        if len(names) <= _MOST_LISTED
        else [*names[: _MOST_LISTED - 1], f"and {len(names) - _MOST_LISTED + 1} more"]
    )
    axis.axis("off")
    axis.text(
        0,
        1,
        "first contact of",
        transform=axis.transAxes,
        va="top",
        color=_INK,
        fontsize=10,
        weight="bold",
    )
    axis.text(
        0,
        0.93,
        "\n".join(shown),
        transform=axis.transAxes,
        va="top",
        color=_INK,
        fontsize=10,
        linespacing=1.35,
    )
    bar = axis.figure.colorbar(
        ScalarMappable(norm, colours),
        cax=axis.inset_axes((0, 0.1, 0.9, 0.04)),
        orientation="horizontal",
    )
    bar.set_label("overlap of the tool with the phantom at rest [mm]", color=_INK, fontsize=9)
    bar.ax.tick_params(colors=_INK, labelsize=9)
    bar.outline.set_visible(False)
    axis.plot([0.02], [0.24], "D", color=_LANDMARK, markersize=5, transform=axis.transAxes)
    axis.text(
        0.07,
        0.24,
        "touched landmark, as stated",
        transform=axis.transAxes,
        va="center",
        color=_INK,
        fontsize=9,
    )


def _draw_phantom(axis: Axes, dataset: Dataset, view: str) -> None:
    """Draw the outline of the phantom at rest, and the landmarks that were touched."""
    from matplotlib.collections import PolyCollection

    body = dataset.geometry
    low, size = 1e3 * body.low, 1e3 * (body.high - body.low)
    across, up = _VIEWS[view]
    vertices, triangles = body.closed_surface
    drawn = list(1e3 * vertices[triangles][..., [across, up]])
    # The lines of all triangles, of which the fill over them leaves the outline.
    for colour, width, order in ((_INK, 2.4, -1.0), (_BOX, 0.5, 0.0)):
        triangles_in_view = PolyCollection(drawn, facecolor=_BOX, edgecolor=colour)
        triangles_in_view.set(linewidth=width, zorder=order, joinstyle="round")
        axis.add_collection(triangles_in_view)
    landmarks = 1e3 * np.array([dataset.config.landmarks[name] for name in dataset.touches.names])
    axis.plot(
        landmarks[:, across],
        landmarks[:, up],
        "D",
        color=_LANDMARK,
        markersize=5,
        zorder=4,
        clip_on=False,
    )
    axis.set_xlim(low[across] - _MARGIN, low[across] + size[across] + _MARGIN)
    axis.set_ylim(low[up] - (_MARGIN if up == 1 else 2.0), low[up] + size[up] + _MARGIN)
    axis.set_xlabel(f"{'xyz'[across]} [mm]", color=_INK, labelpad=2)
    axis.set_ylabel(f"{'xyz'[up]} [mm]", color=_INK, labelpad=2)
    axis.set_title(_TITLES[view], loc="left", fontsize=10, color=_INK)
    axis.tick_params(colors=_INK, labelsize=9)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _draw_path(
    axis: Axes, points: FloatArray, depth: FloatArray, colours: Colormap, norm: Normalize
) -> None:
    from matplotlib.collections import LineCollection

    axis.plot(points[:, 0], points[:, 1], color=_FAINT, linewidth=0.9, zorder=1)
    middle = (depth[1:] + depth[:-1]) / 2
    segments = np.stack([points[:-1], points[1:]], axis=1)
    # The deepest part is drawn last; in a view along the push, the way back would hide it.
    order = np.argsort(middle)[(middle <= 0).sum() :]
    lines = LineCollection(
        list(segments[order]),
        array=middle[order],
        cmap=colours,
        norm=norm,
        linewidth=3.0,
        capstyle="round",
        zorder=2,
    )
    axis.add_collection(lines)


def _number_places(axis: Axes, places: dict[int, FloatArray]) -> None:
    """Number the first contacts [mm], each label farthest from all others."""
    angles = np.arange(8) * np.pi / 4 + np.pi / 8
    taken = [place[:2] for place in places.values()]
    for index, place in places.items():
        around = place[:2] + 6.5 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        others = np.array(taken)
        spot = around[np.linalg.norm(around[:, None] - others, axis=-1).min(axis=1).argmax()]
        taken.append(spot)
        axis.annotate(
            str(index),
            xy=(place[0], place[1]),
            xytext=(spot[0], spot[1]),
            ha="center",
            va="center",
            fontsize=9,
            color=_INK,
            zorder=5,
            bbox={
                "boxstyle": "circle,pad=0.2",
                "facecolor": "white",
                "edgecolor": _INK,
                "linewidth": 0.8,
            },
            arrowprops={"arrowstyle": "-", "color": _INK, "linewidth": 0.8, "shrinkB": 0},
        )
