"""An hour of mixed jobs, kills, a disk that fills, a clock that jumps, and two servers beside each
other.

Run by hand: `make test ARGS="-m slow tests/app/server/test_soak.py -s"`, as a user who may mount.
SOAK_MINUTES and SOAK_SEED change its length and its draws.
"""

from __future__ import annotations

import os
import random
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
from small_dataset import write_valid_dataset
from soaking import Asked, Clock, SmallDisk, Soaked, small_disk
from swept import write_swept_phantom

MINUTES = float(os.environ.get("SOAK_MINUTES", "60"))
pytestmark = [pytest.mark.slow, pytest.mark.timeout(60 * MINUTES + 7200)]
SEED = int(os.environ.get("SOAK_SEED", "1"))
FINISHED = {"done", "failed", "cancelled", "interrupted"}
SWEEP = {
    "dataset": "phantom",
    "parameters": [{"parameter": "tool_radius.radius", "low": 4e-3, "high": 8e-3}],
    "steps": 3,
    "frames": 1,
}


class Soak:
    """Two servers, one of them on a small disk and with a clock that can be set, under one draw of
    events.
    """

    def __init__(self, folder: Path, disk: SmallDisk, sent: tuple[bytes, bytes]) -> None:
        self.disk, self.sent, self.draw = disk, sent, random.Random(SEED)
        self.datasets, self.clock = folder / "datasets", Clock(folder / "clock")
        self.servers = (
            Soaked(folder, disk.folder / "runs", self.clock.environment),
            Soaked(folder, folder / "runs", {}),
        )
        self.full, self.begun, self.made = False, time.monotonic(), 0
        self.left_behind: list[str] = []

    def tell(self, text: str) -> None:
        sys.stderr.write(f"{time.monotonic() - self.begun:7.1f} s  {text}\n")

    def events(self) -> dict[str, tuple[float, Callable[[Soaked], None]]]:
        """What may happen, with its share of all events."""
        return {
            "job": (10.0, self.job),
            "cancel": (1.5, self.cancel),
            "retry": (1.5, self.retry),
            "kill a process": (2.0, self.kill_process),
            "kill the server": (0.6, self.kill_server),
            "fill or empty": (1.2, self.fill_or_empty),
            "set the clock": (1.0, self.set_clock),
        }

    def job(self, server: Soaked) -> None:
        self.made += 1
        whole, broken = self.sent
        kinds = ("import", "broken", "sweep", "diagnosis")
        (kind,) = self.draw.choices(kinds, (3.0, 2.0, 2.0, 0.3))
        name = f"set-{self.made}"
        if kind in ("import", "broken"):
            body = whole if kind == "import" else broken
            server.ask(Asked(f"/api/imports?name={name}", body, name))
        elif kind == "sweep":
            server.ask(Asked("/api/sweeps", {**SWEEP, "seed": self.made}))
        else:
            server.ask(Asked("/api/diagnoses", {"dataset": "phantom", "seed": self.made}))

    def cancel(self, server: Soaked) -> None:
        if server.asked:
            server.client.post(f"/api/jobs/{self.draw.choice(server.asked).job}/cancel")

    def retry(self, server: Soaked) -> None:
        if server.asked:
            server.client.post(f"/api/jobs/{self.draw.choice(server.asked).job}/retry")

    def kill_process(self, server: Soaked) -> None:
        self.tell(f"killed {server.kill_child(self.draw) or 'nothing'}")

    def kill_server(self, server: Soaked) -> None:
        self.tell(f"the server of {server.runs} is killed")
        if not server.kill():
            self.left_behind.append(str(server.runs))
        if not server.start():  # it says that its folder cannot be written, and ends
            self.tell("the server did not start on the full disk")
            assert self.full
            self.disk.empty()
            self.full = False
            assert server.start()
        server.ask_again()

    def fill_or_empty(self, _: Soaked) -> None:
        if self.full:
            self.disk.empty()
        else:
            self.disk.fill()
        self.full = not self.full
        self.tell("the disk is full" if self.full else "the disk has room")

    def set_clock(self, _: Soaked) -> None:
        ahead = self.draw.choice([-86400, -3600, -60, 0, 60, 3600, 86400])
        self.clock.set(ahead)
        self.tell(f"the clock is {ahead} s ahead")

    def run(self) -> None:
        """Let events happen, about one in five seconds."""
        for server in self.servers:
            assert server.start()
        weights = self.events()
        while time.monotonic() - self.begun < 60 * MINUTES:
            (name,) = self.draw.choices(list(weights), [share for share, _ in weights.values()])
            server = self.draw.choice(self.servers)
            try:
                weights[name][1](server)
            except httpx.HTTPError as error:
                self.tell(f"{name}: {error!r}")
                if server.process is not None and server.process.poll() is not None:
                    self.tell(f"the server ended with {server.process.returncode}")
                    self.kill_server(server)
            time.sleep(self.draw.choice([0.1, 1.0, 4.0, 8.0]))

    def settle(self) -> None:
        """End all faults, repeat what is unsure, retry what was interrupted, and wait."""
        self.disk.empty()
        self.full = False
        self.clock.set(0)
        for server in self.servers:
            if server.process is None or server.process.poll() is not None:
                assert server.start()
            end = time.monotonic() + 60
            while server.unsure and time.monotonic() < end:
                server.ask_again()
                time.sleep(1.0)
            assert not server.unsure
            self.wait(server)
            for job in server.jobs():
                if job["state"] == "interrupted":
                    server.client.post(f"/api/jobs/{job['id']}/retry").raise_for_status()
            self.wait(server)

    def wait(self, server: Soaked) -> None:
        """Wait until no job waits or runs; raise AssertionError where none ends for ten minutes."""
        moved, open_before = time.monotonic(), -1
        while still := sum(job["state"] not in FINISHED for job in server.jobs()):
            if still != open_before:
                moved, open_before = time.monotonic(), still
            assert time.monotonic() - moved < 600, f"{still} jobs wait"
            time.sleep(0.5)


@pytest.fixture
def soak(tmp_path: Path) -> Iterator[Soak]:
    write_swept_phantom(tmp_path / "datasets" / "phantom")
    whole = write_valid_dataset(tmp_path / "sent" / "block")
    good = Path(shutil.make_archive(str(tmp_path / "good"), "zip", whole.parent, "block"))
    (whole / "touches.csv").write_text("no,table\n")
    bad = Path(shutil.make_archive(str(tmp_path / "bad"), "zip", whole.parent, "block"))
    with small_disk(tmp_path / "disk", 48) as disk:
        soak = Soak(tmp_path, disk, (good.read_bytes(), bad.read_bytes()))
        try:
            yield soak
        finally:
            for server in soak.servers:
                server.kill()


def test_nothing_is_lost_or_doubled_and_nothing_waits_for_ever(soak: Soak) -> None:
    soak.run()
    soak.settle()
    expected = {"phantom"}
    for server in soak.servers:
        jobs = {job["id"]: job for job in server.jobs()}
        asked = {one.job for one in server.asked}
        soak.tell(f"{server.runs}: {len(jobs)} jobs, refused {server.refused}")
        soak.tell(str(Counter((job["kind"], job["state"]) for job in jobs.values())))
        errors = Counter((job["error"] or {}).get("message", "")[:90] for job in jobs.values())
        for text, count in errors.most_common():
            soak.tell(f"  {count} times: {text or 'no error'}")
        assert set(jobs) == asked
        assert all(job["seconds"] >= 0.0 for job in jobs.values())
        assert 500 not in server.refused
        done = {one.name for one in server.asked if one.name and jobs[one.job]["state"] == "done"}
        expected |= done
        for name in done:
            server.client.get(f"/api/datasets/{name}/check").raise_for_status()
        assert not list(server.runs.glob(".making/*"))
        kept = {f"{one.name}.archive" for one in server.asked if jobs[one.job]["can_retry"]}
        for archive in server.runs.glob("uploads/*"):  # of imports that may be retried
            assert archive.name.split("-", 1)[1] in kept, archive
    found = {one.name for one in soak.datasets.iterdir() if one.is_dir() and one.name[0] != "."}
    assert found == expected
    assert not list(soak.datasets.glob(".importing/*"))
    assert not soak.left_behind
    assert all(server.kill() for server in soak.servers)
