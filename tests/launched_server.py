"""A server in a process of its own, for tests that end it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import job_functions

__all__ = ["client_of", "launched", "until"]

SERVER = """
import pathlib, sys
from palpate.app.main import create_app
from palpate.app.server.serve import serve
from palpate.app.settings import Settings
from job_functions import TARGETS
if __name__ == "__main__":
    place = pathlib.Path(sys.argv[1])
    settings = Settings(runs=place / "runs", datasets=place / "datasets", preload=())
    app = create_app(settings, TARGETS)
    def started(address):
        (place / "address.part").write_text(address)
        (place / "address.part").rename(place / "address")
    serve(app, "127.0.0.1", 0, started)
"""


@contextmanager
def launched(place: Path) -> Iterator[subprocess.Popen[str]]:
    """A server that writes its address into a file."""
    (place / "address").unlink(missing_ok=True)
    (place / "serving.py").write_text(SERVER)
    tests = Path(job_functions.__file__).parent
    searched = os.pathsep.join(str(path) for path in (tests.parent, tests))
    with subprocess.Popen(
        [sys.executable, str(place / "serving.py"), str(place)],
        env=os.environ | {"PYTHONPATH": searched},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def client_of(place: Path) -> Iterator[httpx.Client]:
    until((place / "address").exists)
    with httpx.Client(base_url=(place / "address").read_text(), timeout=30) as client:
        until(lambda: client.get("/health").json() == {"status": "ok"})
        yield client


def until(true: Any, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
