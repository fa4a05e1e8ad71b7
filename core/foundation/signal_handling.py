"""Protection of this process's signal handling from libraries that change it."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["signals_kept"]

_ROOM = 512
"""Bytes for what the system stores of one signal's handling; glibc uses 152."""


@contextmanager
def signals_kept() -> Iterator[None]:
    """Restore the handling of all signals at the end of a block, from any thread (POSIX; elsewhere
    nothing).

    Gmsh sets SIGPIPE to its default, by which the next write to a closed pipe or socket ends a
    server without a word, and removes faulthandler's handlers. Python's `signal.signal` may be
    called in the main thread alone, so that the C library is asked.
    """
    if os.name != "posix":
        yield
        return
    library = ctypes.CDLL(None)
    kept: dict[int, ctypes.Array[ctypes.c_char]] = {}
    for number in signal.valid_signals():
        room = ctypes.create_string_buffer(_ROOM)
        if library.sigaction(int(number), None, room) == 0:
            kept[int(number)] = room
    try:
        yield
    finally:
        for known, room in kept.items():
            if known not in (signal.SIGKILL, signal.SIGSTOP):
                library.sigaction(known, room, None)
