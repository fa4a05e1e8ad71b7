"""Websocket loop that answers only the newest of the waiting messages."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

from fastapi import WebSocket, WebSocketDisconnect

__all__ = ["newest_wins"]


async def newest_wins(websocket: WebSocket, answer: Callable[[str], dict[str, Any]]) -> None:
    """Answer messages of a websocket with `answer`, which runs in a thread. Messages that arrive
    meanwhile replace each other.

    Returns when the connection has ended and no answer is being made any more.
    """
    await websocket.accept()
    newest: list[str] = []
    arrived = asyncio.Event()
    making: list[asyncio.Task[dict[str, Any]]] = []

    async def listen() -> None:
        async for text in websocket.iter_text():
            newest[:] = [text]
            arrived.set()

    async def reply() -> None:
        while True:
            await arrived.wait()
            arrived.clear()
            making[:] = [asyncio.create_task(asyncio.to_thread(answer, newest.pop()))]
            await websocket.send_json(await asyncio.shield(making[0]))

    tasks = [asyncio.create_task(listen()), asyncio.create_task(reply())]
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        task.cancel()
    with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
        await asyncio.gather(*tasks)
    if making:
        await asyncio.wait(making)
