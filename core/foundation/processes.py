"""How a process of a pool behaves towards the one that started it."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import ParamSpec, TypeVar

__all__ = [
    "at_once",
    "bound_to",
    "bound_to_parent",
    "bound_to_process",
    "giving_memory_back",
    "keeping_memory",
]

_DIE_WITH_PARENT = 1
_EVERY = 2.0
"""How often [s] a process looks whether the one it works for is there."""
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _KEPT, _LARGE = -1, -3, 1 << 27, 1 << 25
"""Numbers of glibc's mallopt, and bytes: freed memory that is kept, and the size from which an
array has pages of its own."""


P = ParamSpec("P")
T = TypeVar("T")


def at_once(task: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
    """Carry out a task here and now, where a pool could do it in another process."""
    done: Future[T] = Future()
    done.set_result(task(*args, **kwargs))
    return done


def bound_to_parent() -> None:
    """Leave Ctrl-C to the process that started this one, and end with it (Linux)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(ctypes, "CDLL") and os.name == "posix" and os.uname().sysname == "Linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGTERM)


def bound_to(pid: int) -> None:
    """The same where a fork server stands between: end soon after the process of that number has,
    even if it was killed.
    """
    bound_to_parent()
    bound_to_process(pid)


def bound_to_process(pid: int) -> None:
    """The same for what a thread starts that may end before its process: Linux takes the end of
    that thread for the parent's.
    """
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


def keeping_memory() -> None:
    """Let this process keep up to 128 MB that it has freed, for the arrays of the next solve
    (glibc; elsewhere nothing).

    A solve in a thread that is not the first, or under dask's own settings, else gives its arrays
    back to the system after each use and gets them anew page by page: 1.9 million page faults in 41
    replays instead of 0.2, an eighth of their time.
    """
    if os.name == "posix" and os.uname().sysname == "Linux":
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
        if mallopt is not None:
            mallopt(_MMAP_THRESHOLD, _LARGE)
            mallopt(_TRIM_THRESHOLD, _KEPT)


def giving_memory_back() -> None:
    """Give what this process has freed back to the system (glibc; elsewhere nothing), for after
    work whose arrays differ in size.

    Between them glibc keeps what lies below any array that is still in use: a tenth to a third of
    what a diagnosis' worker held.
    """
    if os.name == "posix" and os.uname().sysname == "Linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
