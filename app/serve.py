"""Running the service on one port."""

from __future__ import annotations

import socket
from collections.abc import Callable

from app.settings import Settings, require_loopback
from core.errors import SetupError

__all__ = ["serve"]


def serve(settings: Settings, started: Callable[[str], None]) -> None:
    """Serve until interrupted; `started(address)` is called once the port is taken. Port 0 takes a free one."""
    import uvicorn  # noqa: PLC0415 (heavy)

    from app.main import create_app  # noqa: PLC0415 (heavy)

    require_loopback(settings.host)
    with socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET, socket.SOCK_STREAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((settings.host, settings.port))
        except OSError as error:
            raise SetupError(
                f"port {settings.port} on {settings.host} cannot be used ({error.strerror}); choose another with --port",
                key="port",
                value=settings.port,
            ) from error
        host = f"[{settings.host}]" if ":" in settings.host else settings.host
        started(f"http://{host}:{listener.getsockname()[1]}")
        config = uvicorn.Config(
            create_app(settings),
            log_level="warning",
            ws_per_message_deflate=False,
            ws_max_size=64 * 2**20,
            timeout_graceful_shutdown=2,
        )
        uvicorn.Server(config).run(sockets=[listener])
