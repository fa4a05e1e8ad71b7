"""Handler of SIGINT and SIGTERM.

It raises KeyboardInterrupt and also records the signal, since an import may swallow the exception.
"""

from __future__ import annotations

import signal
from types import FrameType
from typing import NoReturn

__all__ = ["Stop", "stop"]


class Stop:
    """The handler of both signals; `received` is True after one of them."""

    received = False

    def listen(self) -> None:
        """Handle the signals from now on."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self)

    def __call__(self, number: int, frame: FrameType | None) -> NoReturn:
        self.received = True
        raise KeyboardInterrupt


stop = Stop()
