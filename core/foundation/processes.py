"""Process pools whose processes end with their owner, and how a process handles freed memory."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar

__all__ = [
    "ProcessPool",
    "TimeUsedError",
    "at_once",
    "giving_memory_back",
    "keeping_memory",
    "limited_memory",
    "limited_time",
]

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _KEPT, _LARGE = -1, -3, 1 << 27, 1 << 25
"""Numbers of glibc's mallopt, and bytes: freed memory that is kept, and the size from which an
array has pages of its own."""


P = ParamSpec("P")
T = TypeVar("T")


def at_once(task: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Future[T]:
    """Run a task in this process; return its finished future, as an executor's `submit` would."""
    done: Future[T] = Future()
    done.set_result(task(*args, **kwargs))
    return done


class ProcessPool(ProcessPoolExecutor):
    """Palpate's only process pool: an executor whose processes never outlive their owner.

    Each process uses one thread (the processes are the parallelism), leaves Ctrl-C to its owner,
    keeps freed memory for the next solve, and ends as soon as the process that made the pool has
    ended, even by SIGKILL.

    Args:
        workers: number of processes.
        start: "spawn", or "forkserver" for processes that are made from a server which has
            imported `preload` once.
        preload: modules that the fork server imports.
        begin: called once in each process before its first task, with `args`.
        args: arguments of `begin`.
    """

    def __init__(
        self,
        workers: int,
        *,
        start: Literal["spawn", "forkserver"] = "spawn",
        preload: Sequence[str] = (),
        begin: Callable[..., None] | None = None,
        args: tuple[Any, ...] = (),
    ) -> None:
        for name in _THREADS:
            os.environ.setdefault(name, "1")
        context = get_context(start)
        if preload:
            context.set_forkserver_preload(list(preload))
        super().__init__(workers, context, _begin, (begin, args))

    def terminate(self, patience: float | None = None) -> None:
        """Stop what runs and drop what waits.

        Args:
            patience: wait at most this long [s] for the processes to end, then kill them; None
                does not wait.
        """
        processes = list((self._processes or {}).values())
        # typeshed states another type.
        joining: threading.Thread | None = self._executor_manager_thread  # type: ignore[assignment]
        self.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()
        if patience is None or joining is None:
            return
        # The executor's thread joins the processes. If this thread did so, too, only one of the two
        # would learn that a process has ended.
        joining.join(patience)
        if joining.is_alive():
            for process in processes:
                process.kill()
            joining.join()


def _begin(begin: Callable[..., None] | None, args: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_owner, daemon=True).start()
    keeping_memory()
    if begin is not None:
        begin(*args)


def _end_with_owner() -> None:
    """End this process when its owner has ended: the pipe between them then closes."""
    owner = parent_process()
    if owner is not None:
        wait([owner.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)


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


@contextlib.contextmanager
def limited_memory(more: int) -> Iterator[None]:
    """Raise MemoryError in the block where this process takes `more` bytes of address space
    besides what it has (Linux; elsewhere nothing).
    """
    import resource

    pages = Path("/proc/self/statm")
    if not pages.is_file():
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    most = int(pages.read_text().split()[0]) * resource.getpagesize() + more
    if before[1] != resource.RLIM_INFINITY:
        most = min(most, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


class TimeUsedError(Exception):
    """A block has used the processor time that it may."""


@contextlib.contextmanager
def limited_time(seconds: int) -> Iterator[None]:
    """Raise TimeUsedError in the block once this process has used so much processor time in it; for
    the main thread.
    """
    import resource

    def end(*_: object) -> None:
        raise TimeUsedError(f"{seconds} s of processor time are used")

    used, before = math.ceil(time.process_time()), resource.getrlimit(resource.RLIMIT_CPU)
    handler = signal.signal(signal.SIGXCPU, end)
    resource.setrlimit(resource.RLIMIT_CPU, (used + seconds, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_CPU, before)
        signal.signal(signal.SIGXCPU, handler)


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
