from __future__ import annotations

import time
import uuid
from importlib.metadata import version
from typing import Any

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

PROTOCOL = Subprotocol(f"viser-v{version('viser')}")


def address(client: httpx.Client, path: str) -> str:
    return f"ws://{client.base_url.host}:{client.base_url.port}{path}"


def test_viewer_is_one_page_without_its_own_panels(client: httpx.Client) -> None:
    answer = client.get(f"/viser/{uuid.uuid4()}")
    assert answer.headers["content-type"].startswith("text/html")
    assert "[data-floating-window]" in answer.text


@pytest.mark.parametrize("page", ["short", "with space and more", "x" * 65])
def test_odd_page_names_are_refused(client: httpx.Client, page: str) -> None:
    assert client.get(f"/viser/{page}").status_code == 422


def test_websocket_is_passed_on_both_ways_with_its_protocol(client: httpx.Client) -> None:
    with connect(
        address(client, f"/viser/{uuid.uuid4()}"), subprotocols=[PROTOCOL], max_size=None
    ) as viewer:
        assert viewer.subprotocol == PROTOCOL
        assert isinstance(viewer.recv(timeout=10), bytes)


def test_viewer_of_another_version_is_turned_away_with_the_viewers_own_code(
    client: httpx.Client,
) -> None:
    with connect(
        address(client, f"/viser/{uuid.uuid4()}"), subprotocols=[Subprotocol("viser-v0.0.1")]
    ) as viewer:
        with pytest.raises(ConnectionClosed) as closed:
            viewer.recv(timeout=10)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1002


def test_open_viewers_do_not_keep_the_server_from_ending(place: Any, serve: Any) -> None:
    with (
        serve(place.settings) as client,
        connect(address(client, f"/viser/{uuid.uuid4()}"), subprotocols=[PROTOCOL], max_size=None),
    ):
        began = time.monotonic()
    assert time.monotonic() - began < 15
