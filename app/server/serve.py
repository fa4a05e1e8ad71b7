"""Running the service on one port."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable
from types import FrameType

import uvicorn
from fastapi import FastAPI

from palpate.app.main import create_app
from palpate.app.settings import Settings
from palpate.foundation.errors import SetupError

__all__ = ["Server", "serve"]


class Server(uvicorn.Server):
    """Tells the app's open event streams that it is ending, so that they end first and do not hold
    it up.
    """

    def __init__(self, app: FastAPI) -> None:
        super().__init__(
            uvicorn.Config(
                app,
                log_level="warning",
                ws_per_message_deflate=False,
                ws_max_size=64 * 2**20,
                timeout_graceful_shutdown=3,
            )
        )
        self._app = app

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """On a signal: end the streams, then everything."""
        self._app.state.ending.set()
        super().handle_exit(sig, frame)


def serve(settings: Settings, started: Callable[[str], None]) -> None:
    """Serve until interrupted; `started(address)` is called once the port is taken. Port 0 takes a
    free one.
    """
    app = create_app(settings)
    with socket.socket(
        socket.AF_INET6 if ":" in settings.host else socket.AF_INET, socket.SOCK_STREAM
    ) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((settings.host, settings.port))
        except OSError as error:
            raise SetupError(
                f"port {settings.port} on {settings.host} cannot be used ({error.strerror}); choose another with --port",
                key="port",
                value=settings.port,
            ) from error
        listener.listen()  # so that whoever reads the address can connect at once and only has to wait
        host = f"[{settings.host}]" if ":" in settings.host else settings.host
        started(f"http://{host}:{listener.getsockname()[1]}")
        with contextlib.suppress(KeyboardInterrupt):  # the ordinary way to end it
            Server(app).run(sockets=[listener])
