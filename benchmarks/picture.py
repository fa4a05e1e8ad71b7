"""Pictures beside the tables."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl

__all__ = ["picture"]


@contextmanager
def picture(file: Path, plots: int, size: tuple[float, float]) -> Iterator[list[Any]]:
    """Axes side by side to draw into; at the end they get grid and legend, and are written to
    `file`. Size in inches.
    """
    mpl.use("Agg")
    from matplotlib import pyplot

    figure, rows = pyplot.subplots(1, plots, figsize=size, layout="constrained", squeeze=False)
    yield list(rows[0])
    for axes in rows[0]:
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.legend(frameon=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=120)
    pyplot.close(figure)
