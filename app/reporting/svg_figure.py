"""Figures as inline SVG in the colour variables of the page, so that they follow its theme."""

from __future__ import annotations

import io
import re
from typing import Any

from markupsafe import Markup

__all__ = ["INK", "to_svg"]

INK = {
    "text": "#010101",
    "text-3": "#020202",
    "line": "#030303",
    "extended": "#040404",
    "measured": "#050505",
    "raw": "#060606",
    "floor": "#070707",
}
"""Colours to draw with; `to_svg` replaces each by the page's variable of this name."""


def to_svg(figure: Any) -> Markup:
    """Write a matplotlib figure as SVG without background or size, with text as text."""
    from matplotlib import rc_context

    for axes in figure.axes:
        axes.patch.set_visible(False)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(INK["line"])
        axes.tick_params(colors=INK["text-3"], labelsize=9)
        axes.xaxis.label.set_color(INK["text-3"])
        axes.yaxis.label.set_color(INK["text-3"])
    figure.patch.set_visible(False)
    text = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "palpate"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    svg = text.getvalue()[text.getvalue().index("<svg") :]
    for name, colour in INK.items():
        svg = svg.replace(colour, f"var(--{name})")
    svg = re.sub(
        r"font(-family)?: ([\d.]+px) [^;\"]*", r"font: \2 inherit; font-family: inherit", svg
    )
    return Markup(re.sub(r' (width|height)="[\d.]+pt"', "", svg, count=2))
