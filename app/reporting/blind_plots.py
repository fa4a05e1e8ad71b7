"""Plots of the blind suite."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from palpate.app.reporting.svg_figure import INK, to_svg
from palpate.blind.parameter_errors import ReportedParameter
from palpate.foundation.figure import new_figure
from palpate.foundation.quantities import SHOWN

__all__ = ["gain_plot", "parameter_plot", "reliability_plot"]

_COLUMNS = 5


def reliability_plot(curve: Sequence[dict[str, Any]]) -> str:
    """Stated probability against the true share, with binomial intervals; larger points have more
    cases.
    """
    drawn = new_figure(4.6, 3.8)
    axes = drawn.subplots()
    axes.plot([0, 1], [0, 1], color=INK["text-3"], linewidth=1, linestyle=(0, (4, 3)))
    for row in curve:
        true = row["true"]
        axes.plot(
            [row["stated"]] * 2,
            [true["low"], true["high"]],
            color=INK["extended"],
            linewidth=2,
            solid_capstyle="round",
        )
        axes.scatter(
            row["stated"],
            true["value"],
            s=20 + 8 * math.sqrt(true["n"]),
            color=INK["extended"],
            zorder=3,
        )
        below = true["value"] > 0.5
        axes.annotate(
            str(true["n"]),
            (row["stated"], true["low" if below else "high"]),
            (0, -5 if below else 5),
            textcoords="offset points",
            ha="center",
            va="top" if below else "bottom",
            color=INK["text-3"],
            fontsize=9,
        )
    axes.set(
        xlim=(-0.03, 1.03),
        ylim=(-0.03, 1.03),
        xlabel="probability stated",
        ylabel="share that is true",
    )
    return to_svg(drawn)


def gain_plot(removed: Sequence[float]) -> str:
    """Histogram of the removed share of the reducible error; negative shares count as zero."""
    drawn = new_figure(4.6, 3.8)
    axes = drawn.subplots()
    shares = [100 * min(max(share, 0.0), 1.0) for share in removed]
    axes.hist(shares, bins=list(range(0, 101, 5)), color=INK["extended"], rwidth=0.86)
    axes.axvline(85, color=INK["measured"], linewidth=1.5)
    axes.annotate(
        "aimed at",
        (85, 1),
        (-4, -4),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=9,
        color=INK["text-3"],
    )
    axes.set(xlim=(0, 100), xlabel="reducible error removed [%]", ylabel="cases")
    axes.locator_params(axis="y", integer=True)
    return to_svg(drawn)


def parameter_plot(groups: dict[str, list[ReportedParameter]]) -> str:
    """One panel for each `effect.parameter`: reported against true value, with the reported
    interval; empty without parameters.
    """
    if not groups:
        return ""
    rows = math.ceil(len(groups) / _COLUMNS)
    drawn = new_figure(2.5 * _COLUMNS, 2.5 * rows)
    panels = drawn.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes, (key, reported) in zip(panels, groups.items(), strict=False):
        factor, unit = SHOWN.get(reported[0].unit, (1.0, reported[0].unit))
        _panel(axes, reported, factor)
        effect, _, name = key.partition(".")
        axes.set_title(
            f"{effect}\n{name}{f' [{unit}]' if unit else ''}".replace("_", " "),
            fontsize=9,
            color=INK["text"],
        )
    for axes in panels[len(groups) :]:
        axes.set_visible(False)
    drawn.supxlabel("true", fontsize=10, color=INK["text-3"])
    drawn.supylabel("said", fontsize=10, color=INK["text-3"])
    return to_svg(drawn)


def _panel(axes: Any, reported: Sequence[ReportedParameter], factor: float) -> None:
    ends = [factor * end for one in reported for end in (one.nearest, one.value)]
    low, high = min(ends), max(ends)
    room = 0.12 * (high - low) or 0.1 * abs(high) or 1.0
    span = (low - room, high + room)
    axes.plot(span, span, color=INK["text-3"], linewidth=1, linestyle=(0, (4, 3)))
    for one in reported:
        colour = INK["measured"] if one.covers() is False else INK["extended"]
        if one.low is not None and one.high is not None:
            axes.plot(
                [factor * one.nearest] * 2,
                [factor * one.low, factor * one.high],
                color=colour,
                linewidth=1.2,
            )
        axes.scatter(factor * one.nearest, factor * one.value, s=14, color=colour, zorder=3)
    axes.set(xlim=span, ylim=span)
    axes.locator_params(nbins=4)
