"""Processes that compute for another end with it, however it ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

MAKER = """
import sys
from pathlib import Path
from core.synthetic import Scenario, make_dataset
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
        assert _within(PATIENCE, lambda: len(_session(maker.pid)) >= 5)  # with tracker, fork server and two that compute
        maker.kill()
        maker.wait()
        assert _within(PATIENCE, lambda: not _session(maker.pid))
    finally:
        for process in _session(maker.pid):
            os.kill(process, signal.SIGKILL)


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
