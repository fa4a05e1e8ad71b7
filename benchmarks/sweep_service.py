"""Speed of a sweep over REST, by two processes and by a dask cluster of two workers.

Both are compared with a plain loop in one process:

    python -m benchmarks.sweep_service [POINTS]
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from palpate.app.client import Client
from palpate.dataset import open_dataset
from palpate.foundation.arrays import FloatArray
from palpate.mesh.graded_mesh import REPLAY_GRID
from palpate.sweep import Axis, ParameterSpace, SweepSpec
from palpate.sweep.samplers import point_batches
from palpate.sweep.sweep_data import read_sweep_data
from palpate.sweep.sweep_error import error_from_sums, replay_errors
from palpate.synthetic import HiddenEffect, Scenario, make_dataset

__all__ = ["run"]

POINTS, WORKERS, FRAMES = 200, 2, 2
LOW, HIGH = 4e-3, 8e-3
QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "2s",
}
"""Settings of dask workers' self-monitoring, which by default interrupts 160 times a second."""
SAME = 1e-9
"""Errors [m] that differ by less count as equal: registrations differ in their last digits."""


def run(points: int = POINTS) -> list[Table]:
    """Measure all three; RuntimeError where the errors of a point differ between them."""
    with tempfile.TemporaryDirectory() as place:
        home = Path(place)
        hidden = HiddenEffect("tool_radius", {"radius": 6e-3})
        make_dataset(
            home / "datasets" / "phantom",
            Scenario(effects=(hidden,), sequences=("poke-top-01",)),
            3,
        )
        load = os.getloadavg()[0]
        # The priority of a job's processes, so that other work on the machine slows both equally.
        with ProcessPoolExecutor(1, get_context("spawn"), os.nice, (5,)) as pool:
            pool.submit(os.getpid).result()
            alone, plain = pool.submit(_loop, home, points).result()
        rows = [("plain loop, one process", alone, plain)]
        with _served(home / "a", home, {}) as palpate:
            rows.append(("over REST, two processes", *_swept(palpate, points)))
        with (
            _cluster() as address,
            _served(home / "b", home, {"PALPATE_SCHEDULER": address}) as palpate,
        ):
            rows.append(("over REST, dask of two workers", *_swept(palpate, points)))
    table = Table(
        "how",
        "s",
        "points a minute",
        "times the loop",
        title=f"{points} points of a sweep; load {load:.1f} at the start",
    )
    for name, seconds, errors in rows:
        apart = float(np.abs(errors - plain).max())
        if not apart < SAME:
            raise RuntimeError(f"{name}: errors differ by {apart:g} m from those of the loop")
        table.add_row(
            name, f"{seconds:.1f}", f"{60 * points / seconds:.0f}", f"{alone / seconds:.2f}"
        )
    return [table]


def _loop(home: Path, points: int) -> tuple[float, FloatArray]:
    began = time.monotonic()
    space = ParameterSpace((Axis("tool_radius.radius", LOW, HIGH),))
    read = read_sweep_data(open_dataset(home / "datasets" / "phantom"), (), FRAMES)
    stated, data = read.stated, read.sequences
    grid = REPLAY_GRID.for_tool(stated.tool.radius)
    errors = []
    for values in next(point_batches(SweepSpec(space=space, steps=points, frames=FRAMES))):
        sums = np.array(replay_errors(space.setup(stated, values), data[0], grid).sums)
        errors.append(float(error_from_sums(sums.sum(axis=0), "distance")))
    return time.monotonic() - began, np.array(errors)


def _swept(palpate: Client, points: int) -> tuple[float, FloatArray]:
    """Return the time [s] from the request to the end of the job, and the errors (p,) [m]."""
    began = time.monotonic()
    job = palpate.sweep("phantom", {"tool_radius.radius": (LOW, HIGH)}, steps=points, frames=FRAMES)
    palpate.wait(job["id"])
    seconds = time.monotonic() - began
    rows = sorted(
        (row for row in palpate.points(job["id"]) if row["kind"] == "search"),
        key=lambda row: int(row["number"]),
    )
    return seconds, np.array([row["error"] for row in rows], dtype=float)


@contextmanager
def _served(runs: Path, home: Path, further: dict[str, str]) -> Iterator[Client]:
    command = [
        sys.executable,
        "-m",
        "palpate.app.cli",
        "serve",
        "--port",
        "0",
        "--workers",
        str(WORKERS),
        "--runs",
        str(runs),
    ]
    command += ["--datasets", str(home / "datasets")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "COLUMNS": "200", **further}
    ) as server:
        assert server.stdout is not None
        address = re.search(r"http://[\d.:]+", server.stdout.readline())
        try:
            if address is None:
                raise RuntimeError("the server did not print its address")
            with Client(address[0]) as client:
                yield client
        finally:
            server.terminate()


@contextmanager
def _cluster() -> Iterator[str]:
    import dask.config
    from distributed import LocalCluster

    with (
        dask.config.set(QUIET),
        LocalCluster(n_workers=WORKERS, threads_per_worker=1, dashboard_address=None) as cluster,
    ):  # type: ignore[no-untyped-call]
        yield str(cluster.scheduler_address)


if __name__ == "__main__":
    Console().print(*run(int(sys.argv[1]) if len(sys.argv) > 1 else POINTS))
