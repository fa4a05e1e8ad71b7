"""Figures without a window: made in one way, and written whole as PNG."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["new_figure", "save_figure"]

_DOTS_PER_INCH = 130


def new_figure(width: float, height: float, **options: Any) -> Figure:
    """Make an empty figure that opens no window.

    Args:
        width, height: [inch].
        options: further arguments of matplotlib's `Figure`. The layout is constrained unless
            another one, or None, is given.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), **{"layout": "constrained", **options})
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path, dots_per_inch: int = _DOTS_PER_INCH) -> None:
    """Write a figure as PNG; the file appears whole or not at all."""
    aside = path.with_name(f".{path.name}.part")
    figure.savefig(aside, dpi=dots_per_inch, format="png")
    os.replace(aside, path)
