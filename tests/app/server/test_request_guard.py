from __future__ import annotations

from pathlib import Path

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from palpate.app.main import create_app
from palpate.app.server.request_guard import same_origin
from palpate.app.settings import Settings
from palpate.foundation.errors import SetupError


@pytest.mark.parametrize(
    ("host", "origin", "welcome"),
    [
        ("127.0.0.1:8321", None, True),
        ("localhost:8321", "http://localhost:8321", True),
        ("[::1]:8321", None, True),
        ("[::1]", None, True),
        ("127.0.0.1:8321", "http://127.0.0.1:9999", False),
        ("127.0.0.1:8321", "http://evil.example", False),
        ("127.0.0.1:8321", "null", False),
        ("evil.example:8321", None, False),
        ("evil.example:8321", "http://evil.example:8321", False),
        ("", None, False),
    ],
)
def test_only_pages_of_our_own_under_our_own_names_are_welcome(
    host: str, origin: str | None, welcome: bool
) -> None:
    assert same_origin(host, origin) is welcome


def test_foreign_host_name_is_refused(client: httpx.Client) -> None:
    answer = client.get("/api/jobs", headers={"host": "rebound.example"})
    assert answer.status_code == 403
    assert answer.json()["kind"] == "Refused"


def test_foreign_page_cannot_start_or_read_anything(client: httpx.Client) -> None:
    headers = {"origin": "http://evil.example"}
    assert (
        client.post("/api/diagnoses", json={"dataset": "small"}, headers=headers).status_code == 403
    )
    assert client.get("/api/runs", headers=headers).status_code == 403


@pytest.mark.parametrize("path", ["/viser/abcdefgh", "/api/sessions/abcdefgh/socket"])
def test_foreign_page_cannot_open_a_websocket(client: httpx.Client, path: str) -> None:
    address = f"ws://{client.base_url.host}:{client.base_url.port}{path}"
    with pytest.raises(InvalidStatus, match="403"), connect(address, origin="http://evil.example"):  # type: ignore[arg-type]
        pass


@pytest.mark.parametrize("path", ["/", "/static/js/main.js", "/api/runs", "/viser/abcdefgh"])
def test_every_answer_carries_its_policy(client: httpx.Client, path: str) -> None:
    answer = client.get(path)
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "frame-ancestors 'self'" in policy
    assert ("'unsafe-inline'" in policy) == path.startswith("/viser/")


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.4", "example.org", ""])
def test_addresses_that_others_can_reach_are_refused_without_a_token(
    tmp_path: Path, host: str
) -> None:
    with pytest.raises(SetupError, match="there is no token"):
        create_app(Settings(host=host, runs=tmp_path))


def test_another_name_asks_for_a_token_as_well(tmp_path: Path) -> None:
    with pytest.raises(SetupError, match="there is no token"):
        create_app(Settings(allow_host=("lab.example",), runs=tmp_path))


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.5", "::1", "localhost"])
def test_loopback_addresses_are_served(host: str) -> None:
    assert create_app(Settings(host=host)).title == "Palpate"
