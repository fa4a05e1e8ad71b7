"""What each open page shows: a view in, what is held back; over one websocket, or request by request."""

from __future__ import annotations

import asyncio
import contextlib
from io import BytesIO
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from app.colours import palette
from app.desk import DeskOf
from app.lookout import Standpoint
from app.problems import as_dict
from app.relay import PageId
from app.view import View
from core.errors import PalpateError

__all__ = ["router"]

router = APIRouter(tags=["scene"])
Pixels = Annotated[int, Query(ge=16, le=4096)]


@router.get("/palette")
def colours() -> dict[str, Any]:
    """The colour of each thing and the map of signed errors."""
    return palette()


@router.post("/sessions/{page}/view")
def show(page: PageId, view: View, desk: DeskOf) -> dict[str, Any]:
    """Show this view."""
    return desk.sessions.open(page).show(view)


@router.post("/sessions/{page}/look", status_code=204)
def look(page: PageId, desk: DeskOf, where: Standpoint = "reset") -> None:
    """Turn the camera to the phantom: the depth camera's view, or from the top, the front (along +y), the side (along -x)."""
    desk.sessions.get(page).look(where)


@router.get("/sessions/{page}/still.png", response_class=Response, responses={200: {"content": {"image/png": {}}}})
def still(page: PageId, desk: DeskOf, width: Pixels = 1280, height: Pixels = 720) -> Response:
    """What the page's scene shows now, as its browser renders it; the background is transparent. 404 where no browser shows it."""
    from PIL import Image  # noqa: PLC0415 (heavy)

    stream = BytesIO()
    Image.fromarray(desk.sessions.get(page).still(width, height)).save(stream, "PNG", compress_level=1)
    return Response(stream.getvalue(), media_type="image/png", headers={"cache-control": "no-store"})


@router.get("/sessions/{page}/state")
def state(page: PageId, desk: DeskOf) -> dict[str, Any]:
    """The view held for a page and counts and a digest of the arrays drawn."""
    return desk.sessions.get(page).state()


@router.websocket("/sessions/{page}/socket")
async def socket(websocket: WebSocket, page: PageId, desk: DeskOf) -> None:
    """Views in, states out; views that come while one is being drawn replace each other, so the newest wins."""
    await websocket.accept()
    newest: list[str] = []
    arrived = asyncio.Event()

    async def listen() -> None:
        async for text in websocket.iter_text():
            newest[:] = [text]
            arrived.set()

    async def draw() -> None:
        while True:
            await arrived.wait()
            arrived.clear()
            await websocket.send_json(await asyncio.to_thread(_answer, desk, page, newest.pop()))

    tasks = [asyncio.create_task(listen()), asyncio.create_task(draw())]
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        task.cancel()
    with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
        await asyncio.gather(*tasks)


def _answer(desk: DeskOf, page: str, text: str) -> dict[str, Any]:
    try:
        return desk.sessions.open(page).show(View.model_validate_json(text))
    except ValidationError as error:
        return {"problem": {"kind": "RequestError", "message": error.errors()[0]["msg"], "where": {}}}
    except PalpateError as error:
        return {"problem": as_dict(error)}
