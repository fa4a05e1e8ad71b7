"""Requests that no honest client forms: none is a fault of the server's, and none holds it up."""

from __future__ import annotations

import io
import re
import socket
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from entry_point import entry_point
from raw_requests import answered, raw
from websockets.sync.client import connect

from palpate.app.main import create_app
from palpate.app.server.login import session_of
from palpate.app.server.serve import serve
from palpate.app.settings import Settings
from palpate.foundation.errors import SetupError


@pytest.fixture(
    scope="module",
    params=["a server in this process", pytest.param("the image's", marks=pytest.mark.more)],
)
def client(request: pytest.FixtureRequest, shared_place: Any) -> Iterator[httpx.Client]:
    if request.param == "the image's":
        with entry_point(shared_place.runs.parent) as (_, client):
            yield client
    else:
        with request.getfixturevalue("serve")(shared_place.settings) as client:
            yield client


NAMES = [
    "%00",
    "a%00b",
    "x" * 300,
    "%ED%A0%80",
    "%FF",
    "%2e%2e",
    "a%2Fb",
    "a%0Ab",
    "%F0%9F%92%A9" * 80,
]
"""NUL, too long for a file, half a surrogate, no UTF-8, dots, a slash, a line end, emojis."""
ENDLESS = "/api/jobs/events"


@pytest.mark.parametrize("name", NAMES)
def test_no_path_and_no_query_is_a_fault_of_the_server(client: httpx.Client, name: str) -> None:
    asked = 0
    for path, methods in create_app(Settings(), {}).openapi()["paths"].items():
        if path == ENDLESS:
            continue
        hostile = re.sub(r"{\w+}", name, path)
        if hostile == path:
            hostile += f"?name={name}&sequence={name}&beside={name}&key={name}"
        for method in methods:
            headers = ("content-type: application/json", "content-length: 2", "connection: close")
            line = f"{method.upper()} {hostile}"
            answer = answered(client, raw(client, line, *headers, body=b"{}"))
            assert re.match(rb"HTTP/1.1 [234]", answer), (line, answer[:80])
            asked += 1
    assert asked > 50


@pytest.mark.parametrize(
    "origin", ["http://[bad", "http://[::1", "null", "http://a:99999999", "http://" + "x" * 9000]
)
def test_origin_that_is_no_address_is_refused(client: httpx.Client, origin: str) -> None:
    request = raw(client, "GET /api/datasets", f"origin: {origin}")
    assert answered(client, request).startswith(b"HTTP/1.1 403 ")


def test_body_of_two_lengths_is_refused(client: httpx.Client) -> None:
    chunked = raw(
        client,
        "POST /api/diagnoses",
        "content-length: 2",
        "transfer-encoding: chunked",
        body=b"2\r\n{}\r\n0\r\n\r\n",
    )
    twice = raw(client, "POST /api/diagnoses", "content-length: 2", "content-length: 3", body=b"{}")
    for request in (chunked, twice):
        assert answered(client, request).startswith(b"HTTP/1.1 400 ")


@pytest.mark.parametrize(
    "half",
    [
        b"",
        b"GET /api/datasets HTTP/1.1\r\nhost: x",
        b"POST /api/diagnoses HTTP/1.1\r\nhost: {host}\r\ncontent-length: 50\r\n\r\n{",
    ],
    ids=["nothing", "head", "body"],
)
def test_half_sent_requests_are_dropped_and_slow_nobody(client: httpx.Client, half: bytes) -> None:
    url, begun = client.base_url, time.monotonic()
    half = half.replace(b"{host}", f"{url.host}:{url.port}".encode())
    lines = [socket.create_connection((url.host, url.port or 80), timeout=20) for _ in range(10)]
    for line in lines:
        line.sendall(half)
    client.get("/api/datasets").raise_for_status()
    assert time.monotonic() - begun < 4.0
    for line in lines:
        while line.recv(4096):
            pass
        line.close()
    assert 4.0 < time.monotonic() - begun < 15.0


def test_head_whose_bytes_drip_has_one_limit(client: httpx.Client) -> None:
    url, begun = client.base_url, time.monotonic()
    with socket.create_connection((url.host, url.port or 80), timeout=20) as line:
        with pytest.raises(OSError):  # reset or broken pipe, as it happens
            for byte in b"GET /api/datasets HTTP/1.1\r\nhost: " + b"x" * 100:
                line.sendall(bytes([byte]))
                time.sleep(0.25)
        assert time.monotonic() - begun < 12.0


def test_body_whose_bytes_drip_has_a_limit(client: httpx.Client) -> None:
    url, begun = client.base_url, time.monotonic()
    head = f"POST /api/imports?name=drip HTTP/1.1\r\nhost: {url.host}:{url.port}\r\n"
    with socket.create_connection((url.host, url.port or 80), timeout=20) as line:
        line.sendall(f"{head}content-length: 100000\r\n\r\n".encode())
        with pytest.raises(OSError):
            for _ in range(60):
                line.sendall(b"x")
                time.sleep(0.25)
    assert 4.0 < time.monotonic() - begun < 12.0


def test_body_of_a_later_request_of_a_connection_has_its_own_limit(client: httpx.Client) -> None:
    url = client.base_url
    head = (
        f"POST /api/disk/empty HTTP/1.1\r\nhost: {url.host}:{url.port}\r\ncontent-length: 2\r\n\r\n"
    )
    with socket.create_connection((url.host, url.port or 80), timeout=20) as line:
        for pause in (0.0, 4.0, 4.0):  # beyond the limit of one request in all
            time.sleep(pause)
            line.sendall(head.encode())
            time.sleep(0.2)
            line.sendall(b"{}")
            assert line.recv(4096).startswith(b"HTTP/1.1 200")


def test_websocket_that_says_nothing_and_a_slow_answer_stay(client: httpx.Client) -> None:
    url = client.base_url
    address = f"ws://{url.host}:{url.port}/api/sessions/page-00000000/socket"
    with connect(address, proxy=None) as quiet, client.stream("GET", ENDLESS, timeout=20) as slow:
        first = next(slow.iter_bytes())
        time.sleep(6.5)
        quiet.ping().wait(5)
        quiet.send("{}")
        assert first and not slow.is_closed and slow.status_code == 200
        with pytest.raises(TimeoutError):
            while True:
                quiet.recv(timeout=1)


def test_archive_with_a_file_and_a_folder_of_one_name_is_refused(client: httpx.Client) -> None:
    sent = io.BytesIO()
    with zipfile.ZipFile(sent, "w") as archive:
        archive.writestr("set/a", b"file")
        archive.writestr("set/a/b", b"file in a folder of the same name")
    answer = client.post("/api/imports?name=doubled", content=sent.getvalue())
    end = time.monotonic() + 60
    while answer.status_code < 300 and answer.json()["state"] in ("queued", "running"):
        assert time.monotonic() < end
        time.sleep(0.1)
        answer = client.get(f"/api/jobs/{answer.json()['id']}")
    error = answer.json()["error"] if answer.status_code == 200 else answer.json()
    assert answer.status_code < 500 and error["kind"] == "DatasetError", error


def test_folder_that_cannot_be_written_is_told_before_an_address_is_printed() -> None:
    told: list[str] = []
    app = create_app(Settings(runs=Path("/proc/nothing")), {})
    with pytest.raises(SetupError, match="no file can be made in /proc/nothing"):
        serve(app, "127.0.0.1", 0, told.append)
    assert not told


HALF = '"\\ud800"'
"""Half of a surrogate pair, which JSON may hold and no text can."""
NOTHING = '{"effect": "tool_radius", "parameters": {"radius": NaN}}'


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/api/evaluations", f'{{"dataset": "small", "run": {HALF}}}'),
        ("/api/evaluations", f'{{"dataset": "small", "trainings": [{HALF}]}}'),
        ("/api/trainings", f'{{"dataset": "small", "run": {HALF}}}'),
        ("/api/exports", f'{{"run": {HALF}}}'),
        ("/api/replays", f'{{"dataset": "small", "sequences": [{HALF}]}}'),
        ("/api/replays", f'{{"dataset": "small", "effects": [{NOTHING}]}}'),
        ("/api/sessions/page-00000000/view", f'{{"run": {HALF}, "sequence": "a"}}'),
        ("/api/imports/folder", '{"folder": "a\\u0000b", "name": "x"}'),
        ("/api/imports/folder", f'{{"folder": "/{"y" * 300}", "name": "x"}}'),
    ],
)
def test_no_value_of_a_body_is_a_fault_of_the_server(
    client: httpx.Client, path: str, body: str
) -> None:
    headers = {"content-type": "application/json"}
    answer = client.post(path, content=body, headers=headers)
    assert 400 <= answer.status_code < 500, answer.text


def test_cookies_are_read_in_no_time() -> None:
    begun = time.monotonic()
    assert session_of({"cookie": 'palpate_session="' + "\\a" * 30_000 + '"'}) == ""
    assert session_of({"cookie": "other=1; palpate_session=abc-_1; more=2"}) == "abc-_1"
    assert session_of({"cookie": "xpalpate_session=abc"}) == ""
    assert time.monotonic() - begun < 1.0
