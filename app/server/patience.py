"""A limit on how long a client may take to send a request."""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

__all__ = ["ImpatientProtocol"]

HEAD, PAUSE = 5.0, 5.0
"""Time for the whole head of a request, and longest pause within a body [s]."""
SLOWEST = 1000.0
"""Least mean rate of a body [bytes/s], from `PAUSE` on."""


class ImpatientProtocol(H11Protocol):
    """Uvicorn's HTTP/1.1 that closes a connection whose client stops in the middle of a request.

    Between requests uvicorn's own limit holds.
    """

    _timer: asyncio.TimerHandle | None = None
    _in_head = False
    _begun, _received = 0.0, 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request."""
        super().connection_made(transport)
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Take data, and wait for what the request lacks."""
        if self.conn.their_state is h11.IDLE:  # a request begins
            self._begun, self._received = self.loop.time(), 0
        self._received += len(data)
        super().data_received(data)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the waiting."""
        self._stop()
        super().connection_lost(exc)

    def _wait(self) -> None:
        if self.transport.get_protocol() is not self:  # a websocket has taken over
            self._stop()
            return
        was_in_head, self._in_head = self._in_head, self.conn.their_state is h11.IDLE
        if self._in_head and was_in_head and self._timer is not None:
            return  # the whole head has one limit, however its bytes drip
        self._stop()
        if self._in_head:
            self._timer = self.loop.call_later(HEAD, self._close)
        elif self.conn.their_state is h11.SEND_BODY:
            left = self._begun + PAUSE + self._received / SLOWEST - self.loop.time()
            self._timer = self.loop.call_later(max(0.0, min(PAUSE, left)), self._close)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _close(self) -> None:
        self._timer = None
        if self.flow.read_paused:  # the server is behind, not the client
            self._wait()
        else:
            self.transport.close()
