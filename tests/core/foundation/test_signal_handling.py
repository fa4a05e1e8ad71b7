"""Signal handling is restored after libraries that change it."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
from pathlib import Path
from threading import Thread

import pytest

from palpate.foundation.signal_handling import signals_kept

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")

SCRIPT = """
import os
from palpate.mesh.meshers.gmsh_mesher import _gmsh
with _gmsh():
    pass
read, write = os.pipe()
os.close(read)
try:
    os.write(write, b"to nobody")
except BrokenPipeError:
    print("still here")
"""


def _handling() -> list[int]:
    """Masks of the ignored and of the caught signals 1 to 31."""
    rows = Path("/proc/self/status").read_text().splitlines()
    masks = [row.split()[1] for row in rows if row.startswith(("SigIgn", "SigCgt"))]
    return [int(mask, 16) & 0x7FFFFFFF for mask in masks]


def test_handling_is_restored_from_another_thread() -> None:
    def change() -> None:
        with signals_kept():
            ctypes.CDLL(None).signal(signal.SIGPIPE, 0)
            changed.append(_handling())

    before = _handling()
    changed: list[list[int]] = []
    thread = Thread(target=change)
    thread.start()
    thread.join()
    assert changed[0] != before
    assert _handling() == before


def test_process_that_used_gmsh_outlives_a_write_to_a_closed_pipe() -> None:
    pytest.importorskip("gmsh")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip()) == (0, "still here"), done.stderr
