"""A process that is started at the first task, kept, and restarted after it died."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import TimeoutError as TooLong
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from palpate.foundation.errors import RunError
from palpate.foundation.processes import ProcessPool

__all__ = ["WarmProcess"]

T = TypeVar("T")
_PATIENCE = 60.0
"""Longest time of a task [s]: of a frame without an equilibrium, or with a long history."""
_SET_UP = 600.0
"""Longest time until a model is set up [s]: its dataset is read and registered, its mesh made, and
at the first time its code compiled."""


class WarmProcess:
    """Runs one task at a time in another process."""

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._pool: ProcessPool | None = None
        self._lock = threading.Lock()

    def ask(self, task: Callable[..., T], *args: Any) -> T:
        """Run a task and return its result; raises RunError where it takes too long or its process
        ends.
        """
        late = "this frame was not solved within {:.0f} s; take values nearer to the model's"
        return self._run(self._patience, late, task, *args)

    def set_up(self, task: Callable[..., object], *args: Any) -> None:
        """Run a task on whose result later ones build, which may take minutes; raises RunError as
        `ask`.
        """
        late = "the model was not set up within {:.0f} s; end other programs, and try again"
        self._run(_SET_UP, late, task, *args)

    def _run(self, patience: float, late: str, task: Callable[..., T], *args: Any) -> T:
        """Run a task; `late` says that it took longer than this patience [s]."""
        with self._lock:
            if self._pool is None:
                self._pool = ProcessPool(1)
            try:
                return self._pool.submit(task, *args).result(patience)
            except TooLong:
                self._end()
                raise RunError(late.format(patience)) from None
            except BrokenProcessPool:
                self._end()
                raise RunError(
                    "the process that solves ended, most likely for want of memory; try again"
                ) from None

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._pool is None:
            return
        self._pool.terminate()
        self._pool = None
