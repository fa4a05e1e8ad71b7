"""No process of the server that the image starts outlives it, however it ends."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path

import httpx
import job_functions
import pytest
from entry_point import entry_point
from launched_server import until
from small_dataset import write_valid_dataset

PAIRS = [
    {"cloud": [-0.034, 0.012, 0.342], "mesh": [0.0344, 0.0197, 0.0358]},
    {"cloud": [0.021, -0.008, 0.351], "mesh": [-0.0344, 0.0197, 0.0358]},
    {"cloud": [0.03, 0.02, 0.322], "mesh": [-0.0344, -0.0197, 0.0358]},
]
"""Points of the rest cloud and of the mesh that belong together [m]."""


@pytest.mark.more
@pytest.mark.parametrize("wait", [0.0, 0.4, 1.2, 2.5])
def test_processes_of_a_registration_end_with_a_killed_server(tmp_path: Path, wait: float) -> None:
    """Killed while the child starts, imports, and works."""
    write_valid_dataset(tmp_path / "datasets" / "small")
    with entry_point(tmp_path) as (process, client):
        before = set(job_functions.family(process.pid))

        def ask() -> None:
            with contextlib.suppress(httpx.HTTPError):
                client.post("/api/datasets/small/registrations", json={"pairs": PAIRS})

        asking = threading.Thread(target=ask)
        asking.start()
        until(lambda: set(job_functions.family(process.pid)) - before)
        time.sleep(wait)
        family = job_functions.family(process.pid)
        process.kill()
        process.wait()
        asking.join()
        end = time.monotonic() + 20
        while any(job_functions.alive(one) for one in family) and time.monotonic() < end:
            time.sleep(0.05)
        assert family and not [one for one in family if job_functions.alive(one)]
