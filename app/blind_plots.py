"""The blind suite's plots as SVG whose colours are the page's own variables, so that they are legible in light and in dark."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from typing import Any

from app.sentences import SHOWN
from core.blind.parameters import Said

__all__ = ["gain_plot", "parameter_plot", "reliability_plot"]

INK = {"text": "#010101", "text-3": "#020202", "line": "#030303", "extended": "#040404", "measured": "#050505", "raw": "#060606"}
"""Variables of the page, and the stand-ins that are drawn with."""
_COLUMNS = 5


def reliability_plot(curve: Sequence[dict[str, Any]]) -> str:
    """Stated probability against the share that is true, with binomial intervals; the area of a point grows with its cases."""
    figure = _figure(4.6, 3.8)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color=INK["text-3"], linewidth=1, linestyle=(0, (4, 3)))
    for row in curve:
        true = row["true"]
        axes.plot([row["stated"]] * 2, [true["low"], true["high"]], color=INK["extended"], linewidth=2, solid_capstyle="round")
        axes.scatter(row["stated"], true["value"], s=20 + 8 * math.sqrt(true["n"]), color=INK["extended"], zorder=3)
        below = true["value"] > 0.5
        axes.annotate(
            str(true["n"]), (row["stated"], true["low" if below else "high"]), (0, -5 if below else 5), textcoords="offset points",
            ha="center", va="top" if below else "bottom", color=INK["text-3"], fontsize=9,
        )  # fmt: skip
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), xlabel="probability stated", ylabel="share that is true")
    return _themed(figure)


def gain_plot(removed: Sequence[float]) -> str:
    """How many cases by the share of the reducible error that is removed; below zero counts as zero."""
    figure = _figure(4.6, 3.8)
    axes = figure.subplots()
    shares = [100 * min(max(share, 0.0), 1.0) for share in removed]
    axes.hist(shares, bins=list(range(0, 101, 5)), color=INK["extended"], rwidth=0.86)
    axes.axvline(85, color=INK["measured"], linewidth=1.5)
    axes.annotate(
        "aimed at", (85, 1), (-4, -4), xycoords=("data", "axes fraction"), textcoords="offset points", ha="right", va="top",
        fontsize=9, color=INK["text-3"],
    )  # fmt: skip
    axes.set(xlim=(0, 100), xlabel="reducible error removed [%]", ylabel="cases")
    axes.yaxis.get_major_locator().set_params(integer=True)
    return _themed(figure)


def parameter_plot(groups: dict[str, list[Said]]) -> str:
    """One panel for each `effect.parameter`: what is said against what is true, with the report's interval; no plot of none."""
    if not groups:
        return ""
    rows = math.ceil(len(groups) / _COLUMNS)
    figure = _figure(2.5 * _COLUMNS, 2.5 * rows)
    panels = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes, (key, said) in zip(panels, groups.items(), strict=False):
        factor, unit = SHOWN.get(said[0].unit, (1.0, said[0].unit))
        _panel(axes, said, factor)
        effect, _, name = key.partition(".")
        axes.set_title(f"{effect}\n{name}{f' [{unit}]' if unit else ''}".replace("_", " "), fontsize=9, color=INK["text"])
    for axes in panels[len(groups) :]:
        axes.set_visible(False)
    figure.supxlabel("true", fontsize=10, color=INK["text-3"])
    figure.supylabel("said", fontsize=10, color=INK["text-3"])
    return _themed(figure)


def _panel(axes: Any, said: Sequence[Said], factor: float) -> None:
    ends = [factor * end for one in said for end in (one.nearest, one.value)]
    low, high = min(ends), max(ends)
    room = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    span = (low - room, high + room)
    axes.plot(span, span, color=INK["text-3"], linewidth=1, linestyle=(0, (4, 3)))
    for one in said:
        colour = INK["measured"] if one.covers() is False else INK["extended"]
        if one.low is not None and one.high is not None:
            axes.plot([factor * one.nearest] * 2, [factor * one.low, factor * one.high], color=colour, linewidth=1.2)
        axes.scatter(factor * one.nearest, factor * one.value, s=14, color=colour, zorder=3)
    axes.set(xlim=span, ylim=span)
    axes.locator_params(nbins=4)


def _figure(width: float, height: float) -> Any:
    from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: PLC0415 (heavy)
    from matplotlib.figure import Figure  # noqa: PLC0415 (heavy)

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasSVG(figure)
    return figure


def _themed(figure: Any) -> str:
    """Inline SVG without a background, with text as text, and with the page's variables for the stand-ins."""
    from matplotlib import rc_context  # noqa: PLC0415 (heavy)

    for axes in figure.axes:
        axes.patch.set_visible(False)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(INK["line"])
        axes.tick_params(colors=INK["text-3"], labelsize=9)
        axes.xaxis.label.set_color(INK["text-3"])
        axes.yaxis.label.set_color(INK["text-3"])
    figure.patch.set_visible(False)
    text = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "blind"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()[text.getvalue().index("<svg") :]
    for name, colour in INK.items():
        svg = svg.replace(colour, f"var(--{name})")
    svg = re.sub(r"font(-family)?: ([\d.]+px) [^;\"]*", r"font: \2 inherit; font-family: inherit", svg)
    return re.sub(r' (width|height)="[\d.]+pt"', "", svg, count=2)
