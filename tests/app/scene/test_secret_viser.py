"""Only who knows the secret enters the inner viser server; these tests fail where viser changes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest
import websockets
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from palpate.app.scene.secret_viser import page_of, secret_viser


@pytest.fixture(scope="module")
def viser() -> Iterator[tuple[Any, str]]:
    server, secret = secret_viser()
    yield server, secret
    server.stop()


@pytest.mark.parametrize("path", ["", "/", "/page", "/page/page", "/..//page", "/" + "x" * 43])
def test_stranger_is_refused_before_the_handshake(viser: Any, path: str) -> None:
    server, _ = viser
    address = f"ws://127.0.0.1:{server.get_port()}{path}"
    with pytest.raises(websockets.InvalidStatus, match="403"):
        connect(address, subprotocols=[Subprotocol("viser-v1.1.1")], proxy=None)
    assert httpx.get(address.replace("ws", "http", 1)).status_code == 403
    assert not server.get_clients()


def test_client_with_the_secret_enters_and_its_page_is_known(viser: Any) -> None:
    server, secret = viser
    address = f"ws://127.0.0.1:{server.get_port()}/{secret}/page-1"
    with connect(address, subprotocols=[Subprotocol("viser-v1.1.1")], proxy=None) as line:
        assert line.recv(timeout=10)
        (client,) = server._websock_server._live_connections
        assert page_of(server, client) == "page-1"
