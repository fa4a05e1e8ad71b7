"""Plots of benchmark results, written to a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from palpate.foundation.figure import new_figure, save_figure

__all__ = ["picture"]


@contextmanager
def picture(file: Path, plots: int, size: tuple[float, float]) -> Iterator[list[Any]]:
    """Yield axes side by side to draw into; then add grid and legend and write them to `file`.

    Args:
        file: PNG; its folder is made.
        plots: number of axes.
        size: width and height [inch].
    """
    figure = new_figure(*size)
    row = figure.subplots(1, plots, squeeze=False)[0]
    yield list(row)
    for axes in row:
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.legend(frameon=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, file, dots_per_inch=120)
