"""A sweep over REST whose server is killed in the middle: every point that had ended is kept, and
it goes on from there.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from job_functions import family, gone
from swept import write_swept_phantom

from palpate.app.client import Client

POINTS = 300


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of a server with one dataset, whose tool is larger than stated."""
    folder = tmp_path_factory.mktemp("killed")
    write_swept_phantom(folder / "datasets" / "phantom")
    return folder


@contextmanager
def served(home: Path) -> Iterator[tuple[subprocess.Popen[str], Client]]:
    folders = ("--runs", str(home / "runs"), "--datasets", str(home / "datasets"))
    command = [sys.executable, "-m", "palpate.app.cli", "serve", "--port", "0", *folders]
    environment = {**os.environ, "PALPATE_PRELOAD": "[]", "COLUMNS": "200"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
        assert address is not None
        try:
            with Client(address[0]) as client:
                yield process, client
        finally:
            process.kill()


def several(palpate: Client, sweep: str, many: int) -> list[dict[str, object]]:
    end = time.monotonic() + 240
    while len(found := palpate.points(sweep)) < many:
        assert time.monotonic() < end, palpate.job(sweep)
        time.sleep(0.1)
    return found


def test_killed_server_loses_no_point_and_the_sweep_goes_on(home: Path) -> None:
    with served(home) as (process, palpate):
        asked = {"tool_radius.radius": (4e-3, 8e-3)}
        sweep = palpate.sweep("phantom", asked, method="random", points=POINTS, frames=2)["id"]
        several(palpate, sweep, 4)
        others = family(process.pid)
        assert len(others) >= 3  # the job's process and those that replay
        process.kill()
        process.wait()
        assert gone(others)
    rows = (home / "runs" / "sweeps" / sweep / "points.jsonl").read_text().splitlines()
    with served(home) as (_, palpate):
        assert palpate.job(sweep)["state"] == "interrupted"
        kept = palpate.points(sweep)
        assert len(kept) in (len(rows), len(rows) - 1)  # the last line may have been cut
        assert len(kept) >= 4
        assert palpate.retry(sweep)["attempt"] == 2
        more = {row["number"]: row for row in several(palpate, sweep, len(kept) + 3)}
        assert all(more[row["number"]]["error"] == row["error"] for row in kept)
        palpate.cancel(sweep)
