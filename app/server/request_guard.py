"""Middleware: Host and Origin allow-list, authentication, plain paths, body-size limits."""

from __future__ import annotations

from collections.abc import Collection
from urllib.parse import urlsplit

from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from palpate.app.server.login import Login
from palpate.app.settings import Settings

__all__ = ["RequestGuard", "same_origin"]

LOOPBACK = frozenset({"127.0.0.1", "localhost", "[::1]"})
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self'; script-src 'self'; "
    "connect-src 'self'; frame-src 'self'; frame-ancestors 'self'; "
    "base-uri 'none'; form-action 'self'; object-src 'none'"
)
VIEWER_POLICY = (
    "default-src 'self' data: blob:; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'self' 'unsafe-inline'; connect-src 'self' data: blob:; "
    "frame-ancestors 'self'; object-src 'none'"
)

# Accessible without login: the page's own files, the login, and whether the server works.
OPEN = ("/login", "/logout", "/health")
OPEN_BELOW = "/static/"
UPLOADS = ("/api/imports", "/api/uploads")
WILD = frozenset({"0.0.0.0", "::"})
TRICKS = (b"%2f", b"%5c", b"%2e", b"%00", b"//", b"\\")


class RequestGuard:
    """Refuses foreign Host names (DNS rebinding), foreign Origins (other sites' pages), requests
    without login, ambiguous paths, and bodies that are too large; for requests and websockets.
    """

    def __init__(self, app: ASGIApp, settings: Settings, login: Login | None = None) -> None:
        self._app = app
        self._login = login
        self._largest, self._largest_upload = settings.largest_body, settings.largest_upload
        self._wild = settings.host in WILD
        self._names = LOOPBACK | {
            _bracketed(name) for name in (settings.host, *settings.allow_host)
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on accepted requests, with security headers; answer the others."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        policy = VIEWER_POLICY if scope["path"].startswith("/viser/") else PAGE_POLICY

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_headers(policy)]
            await send(message)

        headers = {
            key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]
        }
        refusal = self._misplaced(scope, headers) or await self._unknown(scope, headers)
        if refusal is None:
            await self._app(scope, self._limited(receive, self._most(scope)), send_with_headers)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await refusal(scope, receive, send_with_headers)

    def _misplaced(self, scope: Scope, headers: dict[str, str]) -> JSONResponse | None:
        names = self._names
        # A server that listens on every address also answers to the one that was called.
        if self._wild and scope.get("server"):
            names = names | {_bracketed(scope["server"][0])}
        if not same_origin(headers.get("host", ""), headers.get("origin"), names):
            source = headers.get("origin") or headers.get("host")
            return _answer(
                403,
                "Refused",
                f"requests from {source} are refused; open the page by its own address, "
                "or --allow-host it",
            )
        if ambiguous(scope):
            return _answer(
                404,
                "RequestError",
                "the path has an empty, encoded or dotted part; write it plainly",
            )
        if "content-length" in headers and "transfer-encoding" in headers:
            return _answer(
                400, "RequestError", "the body has a length and is in chunks: send one of both"
            )
        # A length that is no number is checked while the body arrives.
        length = headers.get("content-length", "0")
        if (
            scope["type"] == "http"
            and length.isascii()
            and length.isdigit()
            and int(length) > self._most(scope)
        ):
            return _answer(413, "RequestError", _too_large(self._most(scope)))
        return None

    async def _unknown(
        self, scope: Scope, headers: dict[str, str]
    ) -> JSONResponse | RedirectResponse | None:
        if self._login is None or scope["path"] in OPEN or scope["path"].startswith(OPEN_BELOW):
            return None
        if await self._login.is_logged_in(headers, (scope.get("client") or ("",))[0]):
            return None
        if scope["path"] == "/" and "authorization" not in headers:
            return RedirectResponse("/login", status_code=303)
        return _answer(
            401,
            "LoginError",
            "log in at /login, or send Authorization: Bearer with the token",
            {"www-authenticate": "Bearer"},
        )

    def _most(self, scope: Scope) -> int:
        """Largest body of a request to this path [bytes]."""
        return self._largest_upload if scope["path"] in UPLOADS else self._largest

    def _limited(self, receive: Receive, most: int) -> Receive:
        """The same body; raises HTTP 413 once it is longer than allowed, whatever its stated
        length.
        """
        got = 0

        async def limited() -> Message:
            nonlocal got
            message = await receive()
            if message["type"] == "http.request":
                got += len(message.get("body", b""))
                if got > most:
                    raise HTTPException(413, _too_large(most))
            return message

        return limited


def same_origin(host: str, origin: str | None, names: Collection[str] = LOOPBACK) -> bool:
    """Whether the Host is one of `names` and the Origin, if sent, is a page of that host."""
    name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
    if name.lower() not in names:
        return False
    try:
        return origin is None or urlsplit(origin).netloc == host
    except ValueError:  # an address that is none
        return False


def ambiguous(scope: Scope) -> bool:
    """Whether a path could be read as another one: dotted parts, doubled slashes, or encoded
    separators.
    """
    raw = (scope.get("raw_path") or b"").split(b"?")[0].lower()
    return any(trick in raw for trick in TRICKS) or any(
        part in (".", "..") for part in scope["path"].split("/")
    )


def _bracketed(name: str) -> str:
    return f"[{name}]" if ":" in name and not name.startswith("[") else name.lower()


def _too_large(largest: int) -> str:
    return f"the body is longer than {largest} bytes"


def _answer(
    status: int, kind: str, message: str, headers: dict[str, str] | None = None
) -> JSONResponse:
    return JSONResponse(
        {"kind": kind, "message": message, "where": {}}, status_code=status, headers=headers
    )


def _headers(policy: str) -> list[tuple[bytes, bytes]]:
    return [
        (b"content-security-policy", policy.encode()),
        (b"x-content-type-options", b"nosniff"),
        # With no-referrer a form of our own page would send Origin: null.
        (b"referrer-policy", b"same-origin"),
        (b"cross-origin-resource-policy", b"same-origin"),
    ]
