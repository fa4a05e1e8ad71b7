"""Speed of a sweep by two processes, compared with a plain loop in one process.

python -m benchmarks.sweep_speed [POINTS]
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from rich.console import Console

from palpate.dataset import open_dataset
from palpate.mesh.graded_mesh import SCREEN_GRID
from palpate.sweep import Axis, ParameterSpace, SweepSpec
from palpate.sweep.executors import ProcessExecutor, run_tasks
from palpate.sweep.samplers import point_batches
from palpate.sweep.sweep_data import read_sweep_data
from palpate.sweep.sweep_error import replay_errors
from palpate.synthetic import HiddenEffect, Scenario, make_dataset

POINTS, WORKERS = 200, 2


def run(points: int) -> tuple[float, float, float]:
    """Return the time of the loop and of the processes [s], and the largest difference of a sum.

    The time of the processes includes their start.
    """
    space = ParameterSpace(
        (Axis("tool_radius.radius", 4e-3, 8e-3), Axis("poisson_ratio.nu", 0.3, 0.49))
    )
    with tempfile.TemporaryDirectory() as folder:
        hidden = HiddenEffect("tool_radius", {"radius": 6e-3})
        make_dataset(
            Path(folder) / "phantom", Scenario(effects=(hidden,), sequences=("poke-top-01",)), 3
        )
        read = read_sweep_data(open_dataset(Path(folder) / "phantom"), (), 4)
        stated, data = read.stated, read.sequences
    grid = SCREEN_GRID.for_tool(stated.tool.radius)
    points_of_sweep = next(point_batches(SweepSpec(space=space, method="random", points=points)))
    tasks = [(space.setup(stated, values), 0) for values in points_of_sweep]
    began = time.monotonic()
    plain = [replay_errors(setup, data[0], grid) for setup, _ in tasks]
    middle = time.monotonic()
    executor = ProcessExecutor(WORKERS, data, grid)
    try:
        spread = dict(one for one in run_tasks(executor, tasks) if one is not None)
    finally:
        executor.close()
    end = time.monotonic()
    pairs = [
        (np.array(one.sums), np.array(spread[number].sums)) for number, one in enumerate(plain)
    ]
    return middle - began, end - middle, max(float(np.abs(a - b).max()) for a, b in pairs)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else POINTS
    alone, together, apart = run(count)
    Console().print(
        f"{count} points: {alone:.1f} s in one process, {together:.1f} s by {WORKERS}: "
        f"{alone / together:.2f} times as fast; largest difference {apart:g}"
    )
