"""Means of a soak: a disk that can be filled, a clock that can be set, and servers that are killed
and started again.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from entry_point import address_of, started
from job_functions import family, gone

__all__ = ["Asked", "Clock", "SmallDisk", "Soaked", "small_disk"]

_CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* CLOCK_REALTIME as if somebody had set it: ahead by the seconds that stand in a file, or stopped
   at them after a "=". */
int clock_gettime(clockid_t id, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(id, now);
    if (id == CLOCK_REALTIME) {
        FILE *file = fopen(getenv("CLOCK_OFFSET"), "r");
        long seconds = 0;
        if (file) {
            if (fscanf(file, "=%ld", &seconds) == 1) now->tv_sec = seconds;
            else if (fscanf(file, "%ld", &seconds) == 1) now->tv_sec += seconds;
            fclose(file);
        }
    }
    return result;
}

time_t time(time_t *seconds) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (seconds) *seconds = now.tv_sec;
    return now.tv_sec;
}
"""


class Clock:
    """The clock of servers that are started with its environment; needs a C compiler.

    Attributes:
        environment: of those servers.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        source, library = folder / "clock.c", folder / "clock.so"
        source.write_text(_CLOCK)
        command = ["cc", "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"]
        subprocess.run(command, check=True)
        self._offset = folder / "offset"
        self.set(0)
        self.environment = {"LD_PRELOAD": str(library), "CLOCK_OFFSET": str(self._offset)}

    def set(self, ahead: int) -> None:
        """Set it `ahead` of the true time [s]."""
        self._write(str(ahead))

    def stop(self) -> None:
        """Let it stand at the present second."""
        self._write(f"={time.time():.0f}")

    def _write(self, text: str) -> None:
        aside = self._offset.with_suffix(".part")
        aside.write_text(text)
        aside.replace(self._offset)


@dataclass(frozen=True)
class SmallDisk:
    """A file system of a few megabytes at `folder`."""

    folder: Path

    @property
    def _ballast(self) -> Path:
        return self.folder / "ballast"

    def fill(self) -> None:
        """Write until nothing more fits."""
        with contextlib.suppress(OSError), self._ballast.open("ab", buffering=0) as sink:
            for block in (2**20, 2**10, 1):
                with contextlib.suppress(OSError):
                    while True:
                        sink.write(b"\0" * block)

    def empty(self) -> None:
        """Delete what fills it."""
        self._ballast.unlink(missing_ok=True)


@contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[SmallDisk]:
    """Mount a small file system; raises CalledProcessError for users who may not."""
    folder.mkdir(parents=True)
    size = f"size={megabytes}m"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(folder)], check=True)
    try:
        yield SmallDisk(folder)
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


@dataclass
class Asked:
    """A request that a server may have accepted.

    Attributes:
        path: address and query.
        body: bytes or JSON.
        name: of the dataset that it makes, if any.
        job: its id, once it is known.
        key: repeats of the request have the same.
    """

    path: str
    body: bytes | dict[str, Any]
    name: str = ""
    job: str = ""
    key: str = field(default_factory=lambda: uuid.uuid4().hex)


@dataclass
class Soaked:
    """A server that is killed and started again, and what was asked of it.

    Attributes:
        place: its working folder, which has the datasets.
        runs: its folder of runs.
        environment: of its start, besides the image's.
        asked: requests whose answer was an id.
        unsure: requests whose answer was lost, or that found the disk full.
        refused: number of answers of each status beyond 299.
    """

    place: Path
    runs: Path
    environment: dict[str, str]
    asked: list[Asked] = field(default_factory=list)
    unsure: list[Asked] = field(default_factory=list)
    refused: dict[int, int] = field(default_factory=dict)
    process: subprocess.Popen[str] | None = None
    client: httpx.Client = field(default_factory=httpx.Client)

    def start(self) -> bool:
        """Start it; return whether it prints an address."""
        self._let_go()
        self.process = started(self.place, "--runs", str(self.runs), more=self.environment)
        try:
            url = address_of(self.process)
        except AssertionError:
            return False
        self.client = httpx.Client(base_url=url, timeout=60, trust_env=False)
        return True

    def kill(self) -> bool:
        """Kill it, if it was started; return whether all its processes end."""
        if self.process is None:
            return True
        children = family(self.process.pid)
        self.process.kill()
        self.process.wait()
        self._let_go()
        return gone(children)

    def _let_go(self) -> None:
        """Close the pipe and the connections of an ended process."""
        if self.process is not None and self.process.stdout is not None:
            self.process.stdout.close()
        self.client.close()

    def kill_child(self, draw: random.Random) -> str:
        """Kill one of its processes; return its command, empty where it has none."""
        assert self.process is not None
        children = family(self.process.pid)
        if not children:
            return ""
        child = draw.choice(children)
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
            os.kill(child, signal.SIGKILL)
            return " ".join(words)[:80]
        return ""

    def ask(self, asked: Asked) -> None:
        """Send a request, and keep it as accepted, as unsure, or not at all where it is refused."""
        content = {"content" if isinstance(asked.body, bytes) else "json": asked.body}
        headers = {"idempotency-key": asked.key}
        try:
            answer = self.client.post(asked.path, headers=headers, **content)  # type: ignore[arg-type]
        except httpx.HTTPError:
            self.unsure.append(asked)
            return
        if answer.status_code == 202:
            asked.job = answer.json()["id"]
            self.asked.append(asked)
            return
        self.refused[answer.status_code] = self.refused.get(answer.status_code, 0) + 1
        if answer.status_code == 500:
            sys.stderr.write(f"{asked.path}: {answer.text}\n")
        if answer.status_code in (500, 507):
            self.unsure.append(asked)

    def ask_again(self) -> None:
        """Repeat what is unsure, with the same keys."""
        waiting, self.unsure = self.unsure, []
        for asked in waiting:
            self.ask(asked)

    def jobs(self) -> list[dict[str, Any]]:
        """All its jobs."""
        found: list[dict[str, Any]] = []
        while True:
            query = {"most": 1000, "after": len(found)}
            page = self.client.get("/api/jobs", params=query).raise_for_status().json()
            found += page
            if not page:
                return found
