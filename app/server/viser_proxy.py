"""The viewer at /viser/<page>: its HTML file, and a relay of its websocket to the inner server."""

from __future__ import annotations

import asyncio
import contextlib
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import websockets
from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from fastapi import Path as Parameter
from fastapi.responses import HTMLResponse
from websockets.asyncio.client import ClientConnection
from websockets.typing import Subprotocol

__all__ = ["PageId", "router"]

router = APIRouter()
PageId = Annotated[str, Parameter(pattern=r"^[A-Za-z0-9-]{8,64}$")]

SENDABLE = (1000, 1001, 1002, 1003, 1008, 1011, 1012, 1013)
# Hides the viewer's own panel, logo and notices, which cover the scene; the page has all controls.
STYLE = """<style>
[data-floating-window], [data-dock-leaf], .mantine-Notifications-root, .mantine-Notification-root,
.mantine-Paper-root[style*="fixed"] {
  display: none !important;
}
html, body, body div[style*="background-color"] { background: transparent !important; }
</style>"""


@lru_cache(maxsize=1)
def viewer_html() -> str:
    """The viewer's page with its panels hidden."""
    import viser

    html = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text(
        encoding="utf-8"
    )
    return html.replace("<title>", STYLE + "<title>", 1)


@router.get("/viser/{page}", include_in_schema=False)
def viewer(page: PageId) -> HTMLResponse:
    """The viewer of one page."""
    return HTMLResponse(viewer_html(), headers={"cache-control": "no-cache"})


@router.websocket("/viser/{page}")
async def relay(websocket: WebSocket, page: PageId) -> None:
    """Relay both directions of the websocket until either side ends."""
    inner = websocket.app.state.services.viewer
    offered = [Subprotocol(name) for name in websocket.scope.get("subprotocols", [])]
    try:
        upstream = await websockets.connect(
            f"ws://127.0.0.1:{inner.port}/{inner.secret}/{page}",
            subprotocols=offered or None,
            max_size=None,
            compression=None,
            ping_interval=None,
            proxy=None,
        )
    except (OSError, websockets.WebSocketException):
        await websocket.close(code=1013)
        return
    async with upstream:
        await websocket.accept(subprotocol=upstream.subprotocol)
        tasks = [
            asyncio.create_task(_up(websocket, upstream)),
            asyncio.create_task(_down(websocket, upstream)),
        ]
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await websocket.close(code=upstream.close_code if upstream.close_code in SENDABLE else 1000)


async def _up(websocket: WebSocket, upstream: ClientConnection) -> None:
    with contextlib.suppress(
        WebSocketDisconnect, websockets.ConnectionClosed, RuntimeError, KeyError
    ):
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            await upstream.send(
                message["bytes"] if message.get("bytes") is not None else message["text"]
            )


async def _down(websocket: WebSocket, upstream: ClientConnection) -> None:
    with contextlib.suppress(WebSocketDisconnect, websockets.ConnectionClosed, RuntimeError):
        async for message in upstream:
            if isinstance(message, bytes):
                await websocket.send_bytes(message)
            else:
                await websocket.send_text(message)
