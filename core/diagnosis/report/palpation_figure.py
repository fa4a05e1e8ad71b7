"""Figure of a palpation: the pushes from above with an inclusion's footprint, and a section."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.report.force_report import PushForces
from palpate.diagnosis.report.inclusion_footprint import Footprint, felt_middle
from palpate.foundation.arrays import FloatArray
from palpate.foundation.figure import new_figure, save_figure
from palpate.setup.phantom_geometry import Geometry

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_palpation", "section"]

INK, FAINT, FOUND = "#2b2f36", "#c9cdd3", "#0f766e"


def draw_palpation(
    path: Path,
    body: Geometry,
    pushes: PushForces,
    shown: Footprint | None,
    cause: dict[str, Any] | None,
) -> None:
    """Draw a palpation as PNG.

    Args:
        path: of the file.
        body: the phantom.
        pushes: with measured and simulated forces.
        shown: footprint of the inclusion; None without one.
        cause: the inclusion's row of the report, with place, depth and cover; None without one.
    """
    wide = cause is not None
    figure = new_figure(12.0 if wide else 6.2, 5.2)
    axes = figure.subplots(1, 2 if wide else 1, squeeze=False)[0]
    drawn = _from_above(axes[0], body, pushes, shown, cause)
    bar = figure.colorbar(drawn, ax=axes[0], location="bottom", shrink=0.7, aspect=32, pad=0.02)
    bar.set_label("measured force over the stated simulation's [%]", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    if cause is not None:
        _cut(axes[1], body, pushes, cause)
        figure.legend(loc="outside lower right", ncols=2, frameon=False, fontsize=9)
    save_figure(figure, path)


def _from_above(
    axes: Axes,
    body: Geometry,
    pushes: PushForces,
    shown: Footprint | None,
    cause: dict[str, Any] | None,
) -> Any:
    """Draw the pushes, coloured by the change of their force; return what the colours belong to."""
    _relief(axes, body)
    change = 100 * (pushes.measured / pushes.stated - 1)
    known = np.isfinite(change)
    limit = max(float(np.abs(change[known]).max(initial=0.0)), CRITERIA.figures.least_force_change)
    place = 1e3 * pushes.place
    if (~known).any():
        axes.scatter(place[~known, 0], place[~known, 1], s=50, marker="x", c=FAINT, zorder=3)
    drawn = axes.scatter(
        place[known, 0],
        place[known, 1],
        s=130,
        c=change[known],
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        edgecolors=INK,
        linewidths=0.8,
        zorder=3,
    )
    if shown is not None:
        closed = 1e3 * _smooth(shown.contour)
        axes.plot(
            *closed[:, :2].T,
            color=FOUND,
            lw=2.2,
            zorder=4,
            label="felt here, half of the strongest",
        )
    if cause is not None:
        axes.plot(
            *_seen_from_above(_line(cause), cause["parameters"]["radius"]["value"]).T,
            color=FOUND,
            lw=1.3,
            ls="--",
            zorder=4,
            label="the lump below",
        )
    axes.set_title("pushes, seen from above", fontsize=11, loc="left")
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    _plain(axes)
    return drawn


def _line(cause: dict[str, Any]) -> FloatArray:
    """Axis (k, 3) [m] of a tube, or centre (1, 3) [m] of a ball."""
    if cause.get("polyline"):
        return np.array(cause["polyline"])
    return np.array([[cause["parameters"][name]["value"] for name in ("x", "y", "z")]])


def _seen_from_above(line: FloatArray, radius: float) -> FloatArray:
    """Closed outline (n, 2) [mm] of a ball around one point [m], or of a tube around a line."""
    if len(line) == 1:
        turn = np.linspace(0, 2 * np.pi, 100)
        around = np.column_stack([np.cos(turn), np.sin(turn)])
        return np.asarray(1e3 * (line[0, :2] + radius * around))
    plan = line[:, :2]
    ways = np.gradient(plan, axis=0)
    left = np.column_stack([-ways[:, 1], ways[:, 0]]) / np.linalg.norm(ways, axis=1)[:, None]
    sides = [plan + radius * left, (plan - radius * left)[::-1]]
    return np.asarray(1e3 * np.concatenate([*sides, sides[0][:1]]))


def _relief(axes: Axes, body: Geometry) -> None:
    """Draw the phantom below the pushes: the rim of a block, or the height of an organ."""
    if body.is_block:
        x, y = 500 * body.size[0], 500 * body.size[1]
        axes.fill([-x, x, x, -x], [-y, -y, y, y], color="#f1f2f4", ec=FAINT, lw=1.2, zorder=0)
        return
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.tri import Triangulation

    vertices, triangles = body.closed_surface
    up = body.facing(vertices[triangles].mean(axis=1))[1][:, 2] > 0.05
    shade = LinearSegmentedColormap.from_list("height", ["#dfe2e6", "#fbfbfc"])
    x, y, z = 1e3 * vertices.T
    axes.tripcolor(Triangulation(x, y, triangles[up]), z, shading="gouraud", cmap=shade, zorder=0)


def _cut(axes: Axes, body: Geometry, pushes: PushForces, cause: dict[str, Any]) -> None:
    """Draw a section through the inclusion's centre: the phantom, the inclusion, and its depth.

    The section lies along x or y, whichever the nearest surface is more inclined to. That through a
    tube is below the push nearest to its axis, along the one more across it.
    """
    from matplotlib.collections import LineCollection

    line = _line(cause)
    centre = felt_middle(line, pushes.place)
    distance, normals = body.facing(centre[None])
    normal = normals[0]
    across = 0 if abs(normal[0]) >= abs(normal[1]) else 1
    if len(line) > 1:
        across = int(np.abs(line[-1, :2] - line[0, :2]).argmin())
    shown = [across, 2]
    outline = 1e3 * section(body, 1 - across, float(centre[1 - across]))
    axes.add_collection(LineCollection(list(outline), colors=INK, linewidths=1.8))
    middle, radius = 1e3 * centre[shown], 1e3 * cause["parameters"]["radius"]["value"]
    turn = np.linspace(0, 2 * np.pi, 120)
    axes.fill(
        middle[0] + radius * np.cos(turn),
        middle[1] + radius * np.sin(turn),
        color=FOUND,
        alpha=0.28,
        ec=FOUND,
        lw=1.5,
    )
    depth, cover = cause["depth"], cause["cover"]
    depth_line = [centre, centre - distance[0] * normal]
    span = [centre + (depth["value"] - depth[end]) * normal for end in ("low", "high")]
    for ends, width in ((depth_line, 1.2), (span, 5.0)):
        line = 1e3 * np.array(ends)[:, shown]
        axes.plot(line[:, 0], line[:, 1], color=FOUND, lw=width, alpha=0.8, solid_capstyle="butt")
    axes.plot(*middle, "o", color=FOUND, ms=4)
    axes.set_title(
        f"centre {_between(depth)} deep\n{_between(cover)} of tissue above it",
        fontsize=11,
        loc="left",
    )
    axes.set(xlabel=f"{'xy'[across]} [mm]", ylabel="z [mm]", aspect="equal")
    axes.autoscale_view()
    axes.margins(0.06)
    _plain(axes)


def section(body: Geometry, axis: int, at: float) -> FloatArray:
    """Cut the surface by the plane x or y = `at` [m].

    Args:
        body: the phantom.
        axis: 0 for x, 1 for y.
        at: [m].

    Returns segments (k, 2, 2) [m]: the other one of x and y, and z.
    """
    axes = [1 - axis, 2]
    vertices, triangles = body.closed_surface
    segments = []
    for corners in vertices[triangles]:
        away, ends = corners[:, axis] - at, []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            if (away[a] < 0) != (away[b] < 0):
                share = away[a] / (away[a] - away[b])
                ends.append(corners[a] + share * (corners[b] - corners[a]))
        if len(ends) == 2:
            segments.append([end[axes] for end in ends])
    return np.array(segments).reshape(-1, 2, 2)


def _smooth(contour: FloatArray) -> FloatArray:
    """Closed smooth curve (n, 3) through the contour's points."""
    closed = np.concatenate([contour, contour[:1]])
    return np.asarray(
        CubicSpline(np.arange(len(closed)), closed, bc_type="periodic")(
            np.linspace(0, len(contour), 160)
        )
    )


def _between(entry: dict[str, Any]) -> str:
    """Value and interval in millimetres."""
    value, low, high = (1e3 * entry[name] for name in ("value", "low", "high"))
    return f"{value:.1f} mm ({low:.1f} to {high:.1f})"


def _plain(axes: Axes) -> None:
    """Remove the frame at top and right; small tick labels."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9, colors=INK)
