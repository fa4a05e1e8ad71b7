"""A viser server that lets in only who knows its secret, and what else needs viser's private parts.

Viser listens on loopback for every process of every user. This is the only module that touches its
private parts; they are those of viser 1.1.1.
"""

from __future__ import annotations

import contextlib
import http
import io
import secrets
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from palpate.foundation.errors import SetupError

if TYPE_CHECKING:
    from viser import ViserServer

__all__ = ["page_of", "secret_viser"]


def secret_viser() -> tuple[ViserServer, str]:
    """Start viser on a free loopback port; return it with the secret, which is the first part of
    the path of every connection that is let in.
    """
    import viser

    secret = secrets.token_urlsafe(32)
    # Viser prints its inner address.
    with contextlib.redirect_stdout(io.StringIO()), _refusing_strangers(secret):
        return viser.ViserServer(host="127.0.0.1", port=0, verbose=False), secret


def page_of(server: ViserServer, client_id: int) -> str:
    """The last part of the path of a client's connection."""
    connection = server._websock_server._live_connections[client_id]
    return connection.request.path.rpartition("/")[2] if connection.request is not None else ""


@contextlib.contextmanager
def _refusing_strangers(secret: str) -> Iterator[None]:
    """Let the websocket server that starts in the block answer 403, before any handshake, to
    requests without the secret.
    """
    serve, guarded = websockets.asyncio.server.serve, list[Any]()

    def serve_guarded(*args: Any, process_request: Any = None, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Response | None:
            given = request.path.removeprefix("/").partition("/")[0]
            if secrets.compare_digest(given.encode(), secret.encode()):
                return None
            return connection.respond(http.HTTPStatus.FORBIDDEN, "")

        guarded.append(process_request)
        return serve(*args, process_request=process, **options)

    websockets.asyncio.server.serve = serve_guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]
    if not guarded:
        raise SetupError("this version of viser starts in another way; install viser 1.1.1")
