"""CPU seconds of this process, which other work on the machine disturbs less than the clock on the
wall.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["timed"]

Result = TypeVar("Result")


def timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """What the work returns, and the CPU seconds it took."""
    begin = time.process_time()
    result = work()
    return result, time.process_time() - begin
