"""The server as the image starts it: the command and the settings of the Dockerfile, in a plain
process.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
from job_functions import family

__all__ = [
    "address_of",
    "ended",
    "entry_point",
    "environment",
    "ports",
    "printed",
    "started",
    "taken_memory",
]

_ROOT = Path(__file__).parents[1]
_DOCKERFILE = (_ROOT / "Dockerfile").read_text()


def _list(instruction: str) -> list[str]:
    """The words of an instruction of the Dockerfile in its list form."""
    (words,) = re.findall(rf"^{instruction} (\[.*\])$", _DOCKERFILE, re.MULTILINE)
    return [str(word) for word in json.loads(words)]


def _command() -> list[str]:
    """The image's entry point.

    PALPATE_COMMAND puts that of another build in its place, on which these tests can be seen to
    fail.
    """
    other = os.environ.get("PALPATE_COMMAND")
    name, *more = shlex.split(other) if other else _list("ENTRYPOINT")
    return [name if other else str(Path(sys.executable).with_name(name)), *more]


def environment() -> dict[str, str]:
    """The environment of the image's processes."""
    settings = re.findall(r"^ENV (.*)$", _DOCKERFILE, re.MULTILINE)
    pairs = [pair.split("=", 1) for line in settings for pair in line.split()]
    return {**os.environ, **dict(pairs), "PYTHONUNBUFFERED": "1"}


def printed(*arguments: str) -> str:
    """All that the entry point prints with these arguments."""
    done = subprocess.run(
        [*_command(), *arguments], env=environment(), capture_output=True, text=True, check=False
    )
    return done.stdout + done.stderr


def started(
    place: Path, *arguments: str, more: Mapping[str, str] | None = None
) -> subprocess.Popen[str]:
    """Start the server in a folder that has `runs` and `datasets`, on a free port.

    Args:
        place: working folder.
        arguments: besides those of the image.
        more: environment variables.
    """
    for name in ("runs", "datasets"):
        (place / name).mkdir(parents=True, exist_ok=True)
    return subprocess.Popen(
        [*_command(), *_list("CMD"), "--port", "0", *arguments],
        cwd=place,
        env={**environment(), **(more or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def address_of(process: subprocess.Popen[str]) -> str:
    """The address that a server prints as soon as it listens."""
    assert process.stdout is not None
    for line in process.stdout:
        if found := re.search(r"http://[\d.:]+", line):
            return found[0]
    raise AssertionError(f"the server ended with {process.wait()} before it printed an address")


@contextmanager
def entry_point(
    place: Path, *arguments: str, more: Mapping[str, str] | None = None
) -> Iterator[tuple[subprocess.Popen[str], httpx.Client]]:
    """A server and a client of it; arguments as for `started`."""
    with started(place, *arguments, more=more) as process:
        try:
            url = address_of(process)
            with httpx.Client(base_url=url, timeout=120, trust_env=False) as client:
                client.get("/health")  # is answered once its processes are there
                yield process, client
        finally:
            process.send_signal(signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(15)
            process.kill()


def ended(client: httpx.Client, identity: str, seconds: float = 60.0) -> dict[str, Any]:
    """A job once it has ended."""
    end = time.monotonic() + seconds
    while True:
        job = client.get(f"/api/jobs/{identity}").raise_for_status().json()
        if job["state"] not in ("queued", "running"):
            return dict(job)
        assert time.monotonic() < end, f"{identity} is still {job['state']}: {job['text']}"
        time.sleep(0.05)


def ports(pid: int) -> set[int]:
    """TCP ports on which a process listens."""
    sockets = set()
    for file in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            if found := re.match(r"socket:\[(\d+)\]", str(file.readlink())):
                sockets.add(found[1])
    rows = [line.split() for line in Path(f"/proc/{pid}/net/tcp").read_text().splitlines()[1:]]
    return {int(row[1].split(":")[1], 16) for row in rows if row[3] == "0A" and row[9] in sockets}


def _memory(pid: int) -> float:
    """Memory of a process and its descendants, shared pages counted once [MiB]."""
    total = 0.0
    for one in (pid, *family(pid)):
        with contextlib.suppress(OSError):
            text = Path(f"/proc/{one}/smaps_rollup").read_text()
            total += sum(map(int, re.findall(r"^Pss:\s+(\d+) kB", text, re.MULTILINE))) / 1024
    return total


@contextmanager
def taken_memory(pid: int) -> Iterator[list[float]]:
    """The memory that a server and its processes take in the block, over that before [MiB]: the
    list's one number is the largest so far.
    """
    before, most, over = _memory(pid), [0.0], threading.Event()

    def watch() -> None:
        while not over.wait(0.02):
            most[0] = max(most[0], _memory(pid) - before)

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    try:
        yield most
    finally:
        over.set()
        watching.join()
