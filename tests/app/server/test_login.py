from __future__ import annotations

import asyncio
import http.client
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from palpate.app.server.login import LASTS, TRIES, WINDOW, Login
from palpate.app.server.tokens import Token

SOCKETS = ["/viser/abcdefgh", "/api/sessions/abcdefgh/socket"]


@dataclass
class Locked:
    """A server that others could reach, and its token."""

    client: httpx.Client
    token: str

    def address(self, path: str) -> str:
        return f"ws://{self.client.base_url.host}:{self.client.base_url.port}{path}"


@pytest.fixture
def locked(place: Any, serve: Any) -> Iterator[Locked]:
    token = Token.make(place.runs)
    with serve(place.settings.model_copy(update={"host": "0.0.0.0"})) as client:
        yield Locked(client, token)


def test_without_token_data_is_refused_and_the_page_leads_to_the_login(locked: Locked) -> None:
    answer = locked.client.get("/api/runs")
    assert (answer.status_code, answer.json()["kind"]) == (401, "LoginError")
    assert answer.headers["www-authenticate"] == "Bearer"
    page = locked.client.get("/")
    assert (page.status_code, page.headers["location"]) == (303, "/login")
    assert (
        locked.client.get("/login").status_code
        == locked.client.get("/static/css/login.css").status_code
        == 200
    )
    assert (
        locked.client.get("/openapi.json").status_code
        == locked.client.get("/viser/abcdefgh").status_code
        == 401
    )


def test_token_is_changed_for_a_cookie_that_scripts_and_other_sites_do_not_get(
    locked: Locked,
) -> None:
    answer = locked.client.post("/login?next=//evil.example", data={"token": locked.token})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")  # never elsewhere
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith("palpate_session=") and cookie.count("palpate_session") == 1
    assert (
        "HttpOnly" in cookie.split("palpate_inside")[0]
        and "samesite=strict" in cookie.lower()
        and "secure" not in cookie.lower()
    )
    assert locked.client.get("/api/runs").status_code == 200
    kept = {"cookie": cookie.split(";")[0]}
    assert locked.client.post("/logout").headers["location"] == "/login"
    assert (
        locked.client.get("/api/runs", headers=kept).status_code == 401
    )  # the session itself is gone, not only its cookie


def test_cookie_is_for_https_alone_where_a_proxy_speaks_https(locked: Locked) -> None:
    answer = locked.client.post(
        "/login", data={"token": locked.token}, headers={"x-forwarded-proto": "https"}
    )
    assert "secure" in answer.headers["set-cookie"].lower()


def test_bearer_opens_rest_and_a_wrong_one_does_not(locked: Locked) -> None:
    assert (
        locked.client.get(
            "/api/runs", headers={"authorization": f"Bearer {locked.token}"}
        ).status_code
        == 200
    )
    assert (
        locked.client.get("/api/runs", headers={"authorization": "Bearer wrong"}).status_code == 401
    )
    assert (
        locked.client.get("/api/runs", headers={"authorization": locked.token}).status_code == 401
    )


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"authorization": "Bearer wrong"}, 401),
        ({"origin": "http://evil.example"}, 403),
        ({"host": "evil.example"}, 403),
    ],
)
def test_an_upload_of_a_stranger_is_refused_and_leaves_nothing(
    locked: Locked, place: Any, headers: Any, status: int
) -> None:
    answer = locked.client.post("/api/imports?name=theirs", content=b"PK" * 50_000, headers=headers)
    assert answer.status_code == status and set(answer.json()) == {"kind", "message", "where"}
    assert not (place.runs / "uploads").exists() and not (place.datasets / "theirs").exists()


def test_wrong_tokens_are_throttled_but_those_inside_stay_inside(locked: Locked) -> None:
    inside = {"authorization": f"Bearer {locked.token}"}
    assert locked.client.get("/api/runs", headers=inside).status_code == 200
    codes = [
        locked.client.post("/login", data={"token": "guess"}).status_code for _ in range(TRIES + 1)
    ]
    assert codes == [401] * TRIES + [429]
    assert locked.client.get("/api/runs", headers=inside).status_code == 200


@pytest.mark.parametrize("path", SOCKETS)
def test_websockets_ask_for_the_login(locked: Locked, path: str) -> None:
    with pytest.raises(InvalidStatus, match="403"), connect(locked.address(path)):
        pass
    protocol = Subprotocol(f"viser-v{version('viser')}")
    with connect(
        locked.address(path),
        additional_headers={"authorization": f"Bearer {locked.token}"},
        subprotocols=[protocol],
    ):
        pass
    with (
        pytest.raises(InvalidStatus, match="403"),
        connect(
            locked.address(path),
            origin="http://evil.example",  # type: ignore[arg-type]
            additional_headers={"authorization": f"Bearer {locked.token}"},
        ),
    ):
        pass


def test_sessions_end_by_themselves_and_throttling_does_too(tmp_path: Path) -> None:
    text, now = Token.make(tmp_path), [0.0]
    login = Login(Token.load(tmp_path), lambda: now[0])
    cookie = {"cookie": f"palpate_session={login.begin()}"}
    assert asyncio.run(login.is_logged_in(cookie, "a"))
    for _ in range(TRIES):
        assert not asyncio.run(login.right("guess", "a"))
    assert login.wait("a") == WINDOW and login.wait("b") == 0.0
    assert not asyncio.run(login.right(text, "a"))  # not looked at
    now[0] = WINDOW + 1.0
    assert asyncio.run(login.right(text, "a"))
    now[0] = LASTS + 1.0
    assert not asyncio.run(login.is_logged_in(cookie, "a"))


@pytest.mark.parametrize(
    "path",
    [
        "/viser/..%2f",
        "/viser/%2e%2e/api/runs",
        "//evil.example",
        "/api//runs",
        "/api/../login",
        "/a%5cb",
    ],
)
def test_paths_that_read_as_two_things_are_refused(client: httpx.Client, path: str) -> None:
    assert _raw(client, "GET", path) == 404


def test_oversized_bodies_are_refused_whether_announced_or_not(client: httpx.Client) -> None:
    body = b'{"dataset": "' + b"x" * 2**21 + b'"}'
    headers = {"content-type": "application/json"}
    said = client.post("/api/diagnoses", content=body, headers=headers)
    chunked = client.post(
        "/api/diagnoses", content=iter([body[: 2**20], body[2**20 :]]), headers=headers
    )
    assert said.status_code == chunked.status_code == 413
    assert set(said.json()) == set(chunked.json()) == {"kind", "message", "where"}


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"{", 422),
        (b"", 422),
        (b"\xff\xfe", 422),
        (b'{"dataset": "\xff"}', 400),
        (b"[" * 100_000, 400),
    ],
)
def test_malformed_json_is_refused_in_the_stable_shape(
    client: httpx.Client, body: bytes, status: int
) -> None:
    answer = client.post(
        "/api/diagnoses", content=body, headers={"content-type": "application/json"}
    )
    assert answer.status_code == status
    assert set(answer.json()) == {"kind", "message", "where"}


def test_two_pages_at_once_each_have_their_own_view(client: httpx.Client, run_name: str) -> None:
    pages = [str(uuid.uuid4()) for _ in range(2)]
    root = f"ws://{client.base_url.host}:{client.base_url.port}/api/sessions"
    with connect(f"{root}/{pages[0]}/socket") as one, connect(f"{root}/{pages[1]}/socket") as two:
        for socket, frame in ((one, 0), (two, 3)):
            socket.send(f'{{"run": "{run_name}", "sequence": "poke-01", "frame": {frame}}}')
            socket.recv(timeout=30)
        states = [client.get(f"/api/sessions/{page}/state").json() for page in pages]
    assert [state["view"]["frame"] for state in states] == [0, 3]


def _raw(client: httpx.Client, method: str, path: str) -> int:
    """The status of a path sent as it is; httpx would tidy it."""
    connection = http.client.HTTPConnection(
        client.base_url.host, client.base_url.port or 80, timeout=20
    )
    connection.request(method, path)
    status = connection.getresponse().status
    connection.close()
    return status
