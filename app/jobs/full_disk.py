"""Waiting for room where the disk is full, so that nothing is lost meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from palpate.app.http_errors import NoSpace, disk_is_full

__all__ = ["PatientWriter"]

P = ParamSpec("P")
T = TypeVar("T")
_PAUSE = 1.0
"""Time between two attempts [s]."""


class PatientWriter:
    """Repeats what writes to the disk until there is room.

    Attributes:
        closing: is set when nothing waits any longer.
        trouble: message while something waits; else empty.
    """

    def __init__(self) -> None:
        self.closing = threading.Event()
        self.trouble = ""

    def write(self, action: Callable[P, T], *args: P.args, **values: P.kwargs) -> T:
        """Call what writes to the disk, again and again while there is no room.

        Raises NoSpace where `closing` is set meanwhile, and what the call raises for other reasons.
        """
        while True:
            try:
                result = action(*args, **values)
            except (NoSpace, OSError) as error:
                if not (isinstance(error, NoSpace) or disk_is_full(error)):
                    raise
                self.trouble = NoSpace().message
                if self.closing.wait(_PAUSE):
                    raise NoSpace from error
            else:
                self.trouble = ""
                return result
