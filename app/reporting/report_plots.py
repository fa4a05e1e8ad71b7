"""Plots of a report: the error of each frame by sequence, and maps of a cast's offset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.app.reporting.svg_figure import INK, to_svg
from palpate.app.storage.run_store import RecordedReplay
from palpate.foundation.figure import new_figure

__all__ = ["drawn_errors", "error_plots", "field_map"]

_COLUMNS, _HEADROOM = 3, 1.06
_LEAST_OFFSET = 1e-5
"""Least end of the scale of a map [m]."""
_VIEWS = (("from above", "x", "y", 1.0), ("from -y", "x", "z", -1.0), ("from +x", "y", "z", 1.0))
"""Views of a map: name, axis to the right, axis upwards, and sign of the way to the viewer along
the third axis."""


def error_plots(replays: Sequence[RecordedReplay], splits: dict[str, str]) -> str:
    """RMS distance [mm] over time [s]: one panel for each sequence, on a common scale; empty
    without replays.
    """
    return to_svg(drawn_errors(replays, splits)) if replays else ""


def drawn_errors(replays: Sequence[RecordedReplay], splits: dict[str, str]) -> Any:
    """The figure of `error_plots` for at least one replay."""
    columns = min(_COLUMNS, len(replays))
    rows = math.ceil(len(replays) / columns)
    drawn = new_figure(3.0 * columns, 1.9 * rows)
    panels = drawn.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes, replay in zip(panels, replays, strict=False):
        time = np.asarray(replay["time"]) - replay["time"][0]
        axes.axhline(1e3 * float(replay["noise_floor"]), color=INK["floor"], linewidth=2)
        for model in ("raw", "extended"):
            axes.plot(
                time, 1e3 * np.asarray(replay[f"distance_{model}"]), color=INK[model], linewidth=1.3
            )
        split = splits.get(replay.name)
        axes.set_title(
            f"{replay.name}{f' ({split})' if split else ''}",
            fontsize=9,
            color=INK["text"],
            loc="left",
        )
        axes.locator_params(nbins=4)
    # After all curves are drawn: a limit that is set earlier is not extended by later ones.
    panels[0].set_ylim(0.0, _HEADROOM * 1e3 * max(_largest(replay) for replay in replays))
    for axes in panels[len(replays) :]:
        axes.set_visible(False)
    drawn.supxlabel("time [s]", fontsize=9, color=INK["text-3"])
    drawn.supylabel("error [mm]", fontsize=9, color=INK["text-3"])
    return drawn


def field_map(cause: dict[str, Any]) -> str:
    """Offset [mm] of a cast from its drawing, seen from three sides; empty for a cause without a
    `field`.
    """
    field = cause.get("field") or {}
    places = 1e3 * np.array(field.get("places") or np.zeros((0, 3)), dtype=float)
    if not len(places):
        return ""
    offset = np.array(field["offset"], dtype=float)
    end = 1e3 * max(float(np.abs(offset).max()), _LEAST_OFFSET)
    drawn = new_figure(9.0, 2.6)
    panels = drawn.subplots(1, len(_VIEWS), squeeze=False).ravel()
    for axes, (view, right, up, sign) in zip(panels, _VIEWS, strict=True):
        first, second = "xyz".index(right), "xyz".index(up)
        towards = sign * places[:, 3 - first - second]
        # What is nearer to the viewer is drawn last.
        order = np.argsort(towards)
        points = axes.scatter(
            places[order, first],
            places[order, second],
            c=1e3 * offset[order],
            cmap="RdBu_r",
            vmin=-end,
            vmax=end,
            s=16,
            linewidths=0,
        )
        axes.set_aspect("equal")
        axes.set_title(view, fontsize=9, color=INK["text"], loc="left")
        axes.set_xlabel(f"{right} [mm]", fontsize=9)
        axes.set_ylabel(f"{up} [mm]", fontsize=9)
    bar = drawn.colorbar(points, ax=panels.tolist(), shrink=0.9)
    bar.set_label("cast over drawing [mm]", fontsize=9, color=INK["text-3"])
    return to_svg(drawn)


def _largest(replay: RecordedReplay) -> float:
    """Largest error or noise floor [m]; NaN is a frame without a comparison."""
    curves = [np.asarray(replay[f"distance_{model}"]) for model in ("raw", "extended")]
    return float(np.nanmax(np.concatenate([*curves, [float(replay["noise_floor"]), 1e-6]])))
