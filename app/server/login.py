"""Login: session cookies, bearer tokens, and a limit on wrong tokens."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Callable, Mapping
from urllib.parse import parse_qs

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse, Response

from palpate.app.server.tokens import Token

__all__ = ["Login", "router"]

COOKIE = "palpate_session"
_SESSION = re.compile(rf"(?:^|;) *{COOKIE}=([A-Za-z0-9_-]{{1,100}}) *(?:;|$)")
"""Its value among the cookies of a request. The standard library's parser takes time that grows
with the square of a hostile header's length."""
INSIDE = "palpate_inside"
"""Cookie that lets the page show "log out"; it authorises nothing."""
LASTS = 12 * 3600.0
"""Lifetime of a session [s]."""
TRIES, WINDOW = 5, 60.0
"""Number of wrong tokens that one address may send within a time [s]."""
router = APIRouter(include_in_schema=False)


class Login:
    """The sessions of one server. They are in memory: a restart logs everybody out."""

    def __init__(self, token: Token, clock: Callable[[], float] = time.monotonic) -> None:
        self._token = token
        self._clock = clock
        self._sessions: dict[str, float] = {}
        self._wrong: dict[str, list[float]] = {}
        self._key = secrets.token_bytes(32)
        # Keyed digest of the right token after its first use, so that later bearers cost no scrypt.
        self._known = b""

    async def is_logged_in(self, headers: Mapping[str, str], peer: str) -> bool:
        """Whether the headers carry a valid session cookie or bearer token."""
        if self._sessions.get(_digest(session_of(headers)), -1.0) > self._clock():
            return True
        scheme, _, text = headers.get("authorization", "").partition(" ")
        return scheme.lower() == "bearer" and await self.right(text.strip(), peer)

    async def right(self, text: str, peer: str) -> bool:
        """Whether this is the token. While an address is throttled, no token from it is checked."""
        fingerprint = hmac.digest(self._key, text.encode(), "sha256")
        if hmac.compare_digest(fingerprint, self._known):
            return True
        if self.wait(peer):
            return False
        tried = self._wrong.setdefault(peer, [])
        # Counted before the comparison, so that simultaneous attempts do not pass the limit.
        tried.append(self._clock())
        if not await asyncio.to_thread(self._token.matches, text):
            return False
        self._known = fingerprint
        self._wrong.pop(peer, None)
        return True

    def wait(self, peer: str) -> float:
        """Time [s] for which tokens from this address are refused."""
        now = self._clock()
        self._wrong = {
            who: [when for when in times if when > now - WINDOW]
            for who, times in self._wrong.items()
            if times
        }
        times = self._wrong.get(peer, [])
        return times[-TRIES] + WINDOW - now if len(times) >= TRIES else 0.0

    def begin(self) -> str:
        """Start a session and return its name for the browser; only its digest is stored."""
        now, name = self._clock(), secrets.token_urlsafe(32)
        self._sessions = {known: end for known, end in self._sessions.items() if end > now}
        self._sessions[_digest(name)] = now + LASTS
        return name

    def end(self, name: str) -> None:
        """Delete a session."""
        self._sessions.pop(_digest(name), None)


def session_of(headers: Mapping[str, str]) -> str:
    """The session that the cookie names; empty if there is none."""
    found = _SESSION.search(headers.get("cookie", ""))
    return found[1] if found else ""


@router.get("/login")
def page(request: Request) -> FileResponse:
    """The login page."""
    return FileResponse(
        request.app.state.settings.static / "login.html", headers={"cache-control": "no-store"}
    )


@router.post("/login")
async def enter(request: Request) -> Response:
    """Exchange the token for a session and redirect to the page; no other redirect target can be
    requested.
    """
    login: Login | None = request.app.state.login
    if login is None:
        return RedirectResponse("/", status_code=303)
    peer = request.client.host if request.client else ""
    form = parse_qs((await request.body()).decode("utf-8", "replace"))
    if wait := login.wait(peer):
        return _refused(
            request,
            429,
            f"too many wrong tokens; try again in {wait:.0f} s",
            {"retry-after": f"{wait:.0f}"},
        )
    if not await login.right(form.get("token", [""])[0].strip(), peer):
        return _refused(
            request,
            401,
            "this is not the token that palpate serve printed; --new-token makes another",
            {},
        )
    answer = RedirectResponse("/", status_code=303)
    secure = request.url.scheme == "https"
    answer.set_cookie(
        COOKIE, login.begin(), max_age=int(LASTS), httponly=True, samesite="strict", secure=secure
    )
    answer.set_cookie(INSIDE, "1", max_age=int(LASTS), samesite="strict", secure=secure)
    return answer


@router.post("/logout")
def leave(request: Request) -> Response:
    """End the session."""
    if request.app.state.login is not None:
        request.app.state.login.end(session_of(request.headers))
    answer = RedirectResponse("/login", status_code=303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="strict")
    answer.delete_cookie(INSIDE, samesite="strict")
    return answer


def _refused(request: Request, status: int, message: str, headers: dict[str, str]) -> Response:
    if "text/html" in request.headers.get("accept", ""):
        return RedirectResponse(f"/login?{'wait' if status == 429 else 'wrong'}", status_code=303)
    return JSONResponse(
        {"kind": "LoginError", "message": message, "where": {}}, status_code=status, headers=headers
    )


def _digest(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()
