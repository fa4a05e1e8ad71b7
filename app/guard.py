"""Who may talk to the server: only pages of its own, by its own loopback names; and the headers that say so to the browser."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlsplit

from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["Guard", "same_origin"]

LOOPBACK = frozenset({"127.0.0.1", "localhost", "[::1]"})
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self'; script-src 'self'; connect-src 'self'; frame-src 'self'; "
    "frame-ancestors 'self'; base-uri 'none'; form-action 'none'; object-src 'none'"
)
VIEWER_POLICY = (
    "default-src 'self' data: blob:; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'self' 'unsafe-inline'; connect-src 'self' data: blob:; "
    "frame-ancestors 'self'; object-src 'none'"
)


class Guard:
    """Refuses foreign Host names (DNS rebinding) and foreign Origins (other sites' pages), for requests and websockets alike."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what is ours, with the security headers; answer 403 to the rest."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]}
        if not same_origin(headers.get("host", ""), headers.get("origin")):
            await _refuse(scope, receive, send, headers)
            return
        policy = VIEWER_POLICY if scope["path"].startswith("/viser/") else PAGE_POLICY

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_headers(policy)]
            await send(message)

        await self._app(scope, receive, send_with_headers)


def same_origin(host: str, origin: str | None) -> bool:
    """Whether the Host is a loopback name and the Origin, if a browser sent one, is a page of that same host."""
    name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
    return name in LOOPBACK and (origin is None or urlsplit(origin).netloc == host)


def _headers(policy: str) -> list[tuple[bytes, bytes]]:
    return [
        (b"content-security-policy", policy.encode()),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-resource-policy", b"same-origin"),
    ]


async def _refuse(scope: Scope, receive: Receive, send: Send, headers: dict[str, Any]) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    source = headers.get("origin") or headers.get("host")
    message = f"requests from {source} are refused; open the page by its own address on this machine"
    body = {"kind": "Refused", "message": message, "where": {}}
    await JSONResponse(body, status_code=403)(scope, receive, send)
