"""One process that solves, kept warm, started when first asked and again after it died."""

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
"""A frame that finds no equilibrium, or a long past, may take so long [s] before it is given up."""


class WarmProcess:
    """Answers one question at a time in a process of its own: the newest answer is what a page
    waits for.
    """

    def __init__(self, patience: float = _PATIENCE) -> None:
        self._patience = patience
        self._pool: ProcessPool | None = None
        self._lock = threading.Lock()

    def ask(self, task: Callable[..., T], *args: Any) -> T:
        """The task's answer; RunError where it takes too long or its process ends."""
        with self._lock:
            if self._pool is None:
                self._pool = ProcessPool(1)
            try:
                return self._pool.submit(task, *args).result(self._patience)
            except TooLong:
                self._end()
                raise RunError(
                    f"this frame found no answer within {self._patience:.0f} s and was given up; take values nearer to the model's"
                ) from None
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
