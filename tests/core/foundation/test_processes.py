"""Processes that compute for another end with it, however it ended."""

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

from palpate.foundation.processes import giving_memory_back

MAKER = """
import sys
from pathlib import Path
from palpate.synthetic import Scenario, make_dataset
if __name__ == "__main__":
    scenario = Scenario(sequences=("poke-top-01", "poke-top-02"), rate=30.0)
    make_dataset(Path(sys.argv[1]), scenario, seed=1, workers=2, report=lambda done, text: None)
"""
PATIENCE = 60.0
"""For processes to start and to end, on a machine that is busy [s]."""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_making_that_is_killed_leaves_no_process_behind(tmp_path: Path) -> None:
    script = tmp_path / "maker.py"
    script.write_text(MAKER)
    root = Path(__file__).parents[2]
    maker = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "made")],
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(root)},
        start_new_session=True,
    )
    try:
        assert _within(
            PATIENCE, lambda: len(_session(maker.pid)) >= 5
        )  # with tracker, fork server and two that compute
        maker.kill()
        maker.wait()
        assert _within(PATIENCE, lambda: not _session(maker.pid))
    finally:
        for process in _session(maker.pid):
            os.kill(process, signal.SIGKILL)


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
