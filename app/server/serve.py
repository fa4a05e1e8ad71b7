"""Run the service on one port."""

from __future__ import annotations

import contextlib
import socket
import sqlite3
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import uvicorn
from fastapi import FastAPI

from palpate.app.http_errors import disk_is_full
from palpate.app.server.diagnostics import note_settings, write_log
from palpate.app.server.patience import ImpatientProtocol
from palpate.foundation.errors import SetupError

__all__ = ["Server", "serve"]


class Server(uvicorn.Server):
    """Uvicorn server that ends the app's open event streams first, so that they do not delay its
    shutdown.
    """

    def __init__(self, app: FastAPI) -> None:
        super().__init__(
            uvicorn.Config(
                app,
                http=ImpatientProtocol,
                log_level="warning",
                ws_per_message_deflate=False,
                ws_max_size=2**20,
                timeout_graceful_shutdown=3,
            )
        )
        self._app = app
        app.state.stop = self.stop

    def stop(self) -> None:
        """End the event streams, then the server."""
        self._app.state.ending.set()
        self.should_exit = True

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the event streams on a signal, then the server."""
        self._app.state.ending.set()
        super().handle_exit(sig, frame)


def serve(app: FastAPI, host: str, port: int, started: Callable[[str], None]) -> None:
    """Serve `app` until interrupted.

    Args:
        app: the application of `create_app`.
        host: address to listen on.
        port: port to listen on; 0 takes a free one.
        started: is called with the server's address as soon as the port is bound and the jobs are
            opened.

    Raises:
        SetupError: the port cannot be used, or the folder of runs not be written, or another server
            works in it.
        SystemExit: the job queue has given up; the status is 1, the message on standard error.
    """
    _refuse_unwritable(app.state.settings.runs)
    _allow_many_files()
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
        except OSError as error:
            raise SetupError(
                f"port {port} on {host} cannot be used ({error.strerror}); "
                "choose another with --port",
                key="port",
                value=port,
            ) from error
        # Clients that read the address can connect at once: the kernel queues them until the
        # server accepts.
        listener.listen()
        _prepare(app)
        write_log(app.state.settings.runs)
        name = f"[{host}]" if ":" in host else host
        started(f"http://{name}:{listener.getsockname()[1]}")
        server = Server(app)
        with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C ends the server
            server.run(sockets=[listener])
    if app.state.failure:
        raise SystemExit(app.state.failure)


def _prepare(app: FastAPI) -> None:
    """Open the jobs and note the settings, before an address is told."""
    settings = app.state.settings
    try:
        app.state.prepare()
        note_settings(settings.runs, settings.model_dump(mode="json"))
    except (OSError, sqlite3.Error) as error:
        reason = "its disk is full: make room" if disk_is_full(error) else f"{error}"
        raise SetupError(
            f"the folder of runs {settings.runs} cannot be used ({reason}), "
            "or choose another with --runs",
            key="runs",
            value=str(settings.runs),
        ) from error


def _allow_many_files() -> None:
    """Let this process open as many files as the system allows it: each connection is one, and the
    usual thousand is soon taken.
    """
    if sys.platform != "win32":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _refuse_unwritable(runs: Path) -> None:
    """Raise SetupError for a folder of runs in which no file can be made."""
    try:
        runs.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=runs):
            pass
    except OSError as error:
        raise SetupError(
            f"no file can be made in {runs} ({error.strerror}): choose another folder with --runs",
            key="runs",
            value=str(runs),
        ) from error
