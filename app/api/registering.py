"""Manual registration in the scene of a page: drawing, and picking of points by clicks."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from palpate.app.scene.registration_scene import Ray
from palpate.app.schemas import Point, RegistrationView
from palpate.app.server.viser_proxy import PageId
from palpate.app.services import CurrentServices

__all__ = ["router"]

router = APIRouter(prefix="/sessions/{page}/registering", tags=["registrations"])
Step = Annotated[FiniteFloat, Field(ge=-0.1, le=0.1)]


class Nudge(BaseModel):
    """A point of one side, and its shift [m] to the right and upwards on the screen."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [{"side": "mesh", "point": [0.01, 0.0, 0.0358], "right": 2e-4}]
        },
    )

    side: Literal["cloud", "mesh"]
    point: Point
    right: Step = 0.0
    up: Step = 0.0


class Aim(BaseModel):
    """A ray of a click, in the frame of the scene.

    Attributes:
        origin: [m].
        direction: of any length.
        pixel: angle of a pixel [rad].
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [{"origin": [0.0, 0.0, 0.3], "direction": [0.0, 0.0, -1.0]}]
        },
    )

    origin: Point
    direction: Point
    pixel: FiniteFloat = Field(default=1e-3, gt=0.0, le=0.1)


@router.post("")
def show(page: PageId, shown: RegistrationView, services: CurrentServices) -> dict[str, Any]:
    """Show rest cloud and phantom with these pairs; the answer has the numbers of points and marks,
    and the pose of the cloud [m].
    """
    return services.manual_registrations.open(page).show(shown)


@router.post("/look", status_code=204)
def look(page: PageId, services: CurrentServices) -> None:
    """Turn the camera to cloud and phantom."""
    services.manual_registrations.open(page).look()


@router.post("/nudge")
def nudge(page: PageId, shift: Nudge, services: CurrentServices) -> dict[str, Any]:
    """Move a point on its surface by an arrow key; 404 while no scene is open."""
    return {
        "point": services.manual_registrations.open(page).nudge(
            shift.side, shift.point, shift.right, shift.up
        )
    }


@router.post("/pick")
def pick(page: PageId, aim: Aim, services: CurrentServices) -> dict[str, Any]:
    """The point that a click along this ray selects on the active side."""
    return services.manual_registrations.open(page).pick(
        Ray(np.array(aim.origin), np.array(aim.direction), aim.pixel)
    )


@router.websocket("/clicks")
async def clicks(websocket: WebSocket, page: PageId, services: CurrentServices) -> None:
    """Send the point of each click in the scene."""
    await websocket.accept()
    loop, waiting = asyncio.get_running_loop(), asyncio.Queue[dict[str, Any]]()

    def send_later(answer: dict[str, Any]) -> None:
        loop.call_soon_threadsafe(waiting.put_nowait, answer)

    stop = services.manual_registrations.open(page).listen(send_later)

    async def send() -> None:
        while True:
            await websocket.send_json(await waiting.get())

    async def hear() -> None:
        async for _ in websocket.iter_text():
            pass

    tasks = [asyncio.create_task(send()), asyncio.create_task(hear())]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        stop()
        for task in tasks:
            task.cancel()
        with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
            await asyncio.gather(*tasks)
