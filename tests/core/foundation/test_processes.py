"""A pool's processes end with the process that made the pool, however that ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from palpate.foundation.processes import (
    ProcessPool,
    TimeUsedError,
    giving_memory_back,
    limited_memory,
    limited_time,
)

OWNER = """
import sys, time
from palpate.foundation.processes import ProcessPool
if __name__ == "__main__":
    pool = ProcessPool(2, start=sys.argv[1])
    for _ in range(2):
        pool.submit(time.sleep, 600)
    time.sleep(600)
"""
MEMBERS = {"spawn": 4, "forkserver": 5}
"""Owner, resource tracker, fork server and two workers."""
PATIENCE = 60.0
"""For processes to start and to end, on a machine that is busy [s]."""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_pool_whose_owner_is_killed_leaves_no_process_behind(start: str, tmp_path: Path) -> None:
    script = tmp_path / "owner.py"
    script.write_text(OWNER)
    owner = subprocess.Popen([sys.executable, str(script), start], start_new_session=True)
    try:
        assert _within(PATIENCE, lambda: len(_session(owner.pid)) >= MEMBERS[start])
        owner.kill()
        owner.wait()
        assert _within(PATIENCE, lambda: not _session(owner.pid))
    finally:
        for process in _session(owner.pid):
            os.kill(process, signal.SIGKILL)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_terminated_pool_kills_a_process_that_ignores_it() -> None:
    pool = ProcessPool(1)
    pool.submit(signal.signal, signal.SIGTERM, signal.SIG_IGN).result(PATIENCE)
    pool.submit(time.sleep, 600)
    (process,) = pool._processes
    pool.terminate(1.0)
    assert not _runs(process)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_terminated_pool_waits_until_its_processes_have_ended() -> None:
    pool = ProcessPool(1)
    future = pool.submit(time.sleep, 600)
    assert _within(PATIENCE, future.running)
    (process,) = pool._processes
    pool.terminate(PATIENCE)
    assert not _runs(process)


def test_pool_begins_each_process_as_asked(tmp_path: Path) -> None:
    with ProcessPool(1, begin=os.chdir, args=(tmp_path,)) as pool:
        assert pool.submit(os.getcwd).result(PATIENCE) == str(tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc, and tells glibc")
def test_freed_arrays_below_one_in_use_are_given_back() -> None:
    arrays = [np.ones(10_000) for _ in range(2000)]
    del arrays[:-1]
    before = _resident()
    giving_memory_back()
    assert before - _resident() > 0.5 * 2000 * arrays[-1].nbytes


def _resident() -> int:
    """Memory of this process [bytes]."""
    rows = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return 1024 * next(int(row.split()[1]) for row in rows if row.startswith("Rss:"))


def _runs(process: int) -> bool:
    """Whether a process is there and is no zombie."""
    try:
        text = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] != "Z"


def _within(seconds: float, holds: Callable[[], bool]) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if holds():
            return True
        time.sleep(0.2)
    return False


def _session(leader: int) -> list[int]:
    """Processes of the session that this one began, zombies aside."""
    found = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, session = place.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(session) == leader and state != "Z":
            found.append(int(place.parent.name))
    return found


def test_memory_beyond_a_limit_is_refused_in_the_block_alone() -> None:
    with limited_memory(2**28):
        with pytest.raises(MemoryError):
            np.ones(2**27)
        assert np.ones(2**20).sum() == 2**20
    assert np.ones(2**27)[-1] == 1.0


def test_processor_time_beyond_a_limit_ends_the_block() -> None:
    with pytest.raises(TimeUsedError, match="1 s of processor time"), limited_time(1):
        while True:
            sum(range(1000))
    end = time.process_time() + 0.1
    while time.process_time() < end:  # and nothing after it
        sum(range(1000))
