"""Measurement of CPU time, which other work on the machine disturbs less than wall time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["timed"]

Result = TypeVar("Result")


def timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """Run a function; return its result and its CPU time [s]."""
    begin = time.process_time()
    result = work()
    return result, time.process_time() - begin
