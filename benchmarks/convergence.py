"""Order of convergence: error and time over the grid size, for linear and quadratic elements.

Also plotted, to runs/convergence.png.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.cpu_time import timed
from benchmarks.plot_file import picture
from benchmarks.reference_pokes import compared, poke_frames, reference
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec

__all__ = ["run"]

PICTURE = Path("runs/convergence.png")
NODES = ((9, 7, 5), (13, 9, 9), (17, 13, 9), (25, 17, 13))
SPACING = (2.4e-3, 1.6e-3, 1.2e-3, 0.8e-3)
"""Distance of nodes at the tool [m]; each grid is a refinement of the one before."""
FRAMES = 8


@dataclass(frozen=True, eq=False)
class Point:
    """The result of one grid.

    Attributes:
        unknowns: number of unknowns.
        spacing: distance of nodes at the tool [m].
        displacement: (2,) relative errors of the displacement at 4 and 8 mm [1].
        force: (2,) relative errors of the force at 4 and 8 mm [1].
        seconds: CPU time of a frame [s].
    """

    unknowns: int
    spacing: float
    displacement: FloatArray
    force: FloatArray
    seconds: float


def _point(order: int, nodes: tuple[int, int, int], spacing: float) -> Point:
    grid = GridSpec(nodes=nodes, spacing=spacing, order=order)
    poke_frames(grid)  # warm-up: compilation and symbolic factorisation
    frames, seconds = timed(lambda: poke_frames(grid))
    displacement, force = reference().error(compared(frames))
    x, y, z = nodes
    return Point(3 * x * y * (z - 1), spacing, displacement, np.abs(force), seconds / FRAMES)


def _slope(x: list[float], y: list[float]) -> float:
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def run() -> list[Table]:
    """Solve the reference pokes on refined grids.

    Raises RuntimeError unless the finest grid halves the error of the coarsest.
    """
    table = Table(
        "elements",
        "unknowns",
        "mm at tool",
        "top off by",
        "force off by",
        "ms a frame",
        title="Finer grids, 4 / 8 mm",
    )
    orders = Table(
        "elements", "displacement ~ h^", "force ~ h^", "time ~ unknowns^", title="Fitted at 8 mm"
    )
    series = {}
    for order, name in ((1, "trilinear"), (2, "quadratic")):
        points = [
            _point(order, nodes, spacing) for nodes, spacing in zip(NODES, SPACING, strict=True)
        ]
        series[name] = points
        if not points[-1].displacement[1] < 0.5 * points[0].displacement[1]:
            errors = [float(point.displacement[1]) for point in points]
            raise RuntimeError(f"{name} elements do not converge: {errors}")
        for point in points:
            (near, deep), (light, heavy) = point.displacement, point.force
            table.add_row(
                name,
                str(point.unknowns),
                f"{1e3 * point.spacing:.1f}",
                f"{near:.1%} / {deep:.1%}",
                f"{light:.1%} / {heavy:.1%}",
                f"{1e3 * point.seconds:.0f}",
            )
        spacing, unknowns = (
            [point.spacing for point in points],
            [float(point.unknowns) for point in points],
        )
        orders.add_row(
            name,
            f"{_slope(spacing, [point.displacement[1] for point in points]):.1f}",
            f"{_slope(spacing, [point.force[1] for point in points]):.1f}",
            f"{_slope(unknowns, [point.seconds for point in points]):.1f}",
        )
    _draw(series)
    return [table, orders]


def _draw(series: dict[str, list[Point]]) -> None:
    with picture(PICTURE, 2, (9, 4)) as (errors, times):
        for (name, points), colour in zip(series.items(), ("tab:blue", "tab:orange"), strict=True):
            spacing, unknowns = (
                [1e3 * point.spacing for point in points],
                [point.unknowns for point in points],
            )
            errors.loglog(
                spacing,
                [100 * point.displacement[1] for point in points],
                "o-",
                color=colour,
                label=f"{name}, top",
            )
            errors.loglog(
                spacing,
                [100 * point.force[1] for point in points],
                "s--",
                color=colour,
                label=f"{name}, force",
            )
            times.loglog(
                unknowns, [1e3 * point.seconds for point in points], "o-", color=colour, label=name
            )
        errors.set(xlabel="node spacing at the tool, mm", ylabel="error at 8 mm, %")
        times.set(xlabel="unknowns", ylabel="CPU time of a frame, ms")
