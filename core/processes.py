"""How a process of a pool behaves towards the one that started it."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time

__all__ = ["bound_to", "bound_to_parent", "bound_to_process"]

_DIE_WITH_PARENT = 1
_EVERY = 2.0
"""How often [s] a process looks whether the one it works for is there."""


def bound_to_parent() -> None:
    """Leave Ctrl-C to the process that started this one, and end with it (Linux)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(ctypes, "CDLL") and os.name == "posix" and os.uname().sysname == "Linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGTERM)


def bound_to(pid: int) -> None:
    """The same where a fork server stands between: end soon after the process of that number has, even if it was killed."""
    bound_to_parent()
    threading.Thread(target=_end_after, args=(pid,), daemon=True).start()


def bound_to_process(pid: int) -> None:
    """The same for what a thread starts that may end before its process: Linux takes the end of that thread for the parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_after, args=(pid,), daemon=True).start()


def _end_after(pid: int) -> None:
    while True:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            os.kill(os.getpid(), signal.SIGTERM)
            return
        time.sleep(_EVERY)
