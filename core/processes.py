"""How a process of a pool behaves towards the one that started it."""

from __future__ import annotations

import ctypes
import os
import signal

__all__ = ["bound_to_parent"]

_DIE_WITH_PARENT = 1


def bound_to_parent() -> None:
    """Leave Ctrl-C to the process that started this one, and end with it (Linux)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(ctypes, "CDLL") and os.name == "posix" and os.uname().sysname == "Linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGTERM)
