"""What if: a frame solved again with causes of one's own choice."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, WebSocket
from pydantic import ValidationError

from palpate.app.http_errors import Missing, as_dict
from palpate.app.jobs.whatif_process import InteractiveSession
from palpate.app.reporting.json_values import finite
from palpate.app.scene.page_session import FrameOverride, InteractiveOverride
from palpate.app.schemas import LiveRequest, WhatIfRequest
from palpate.app.server.newest_wins import newest_wins
from palpate.app.server.viser_proxy import PageId
from palpate.app.services import CurrentServices, Services
from palpate.foundation.errors import PalpateError

if TYPE_CHECKING:
    from palpate.recording.interactive import InteractiveFrame

__all__ = ["router"]

router = APIRouter(tags=["what if"])


@router.get("/runs/{name}/sequences/{sequence}/whatif")
def beginnings(name: str, sequence: str, services: CurrentServices) -> dict[str, Any]:
    """The model's effects, and a finite size of every effect of the catalogue, from which to go on
    by hand.
    """
    run = services.runs.get(name)
    run.replay(sequence)
    return {
        "model": run.model.get("effects", []),
        "beginnings": services.frame_solver.beginnings(run, sequence),
    }


@router.post("/runs/{name}/sequences/{sequence}/whatif")
def solve(
    name: str, sequence: str, request: WhatIfRequest, services: CurrentServices
) -> dict[str, Any]:
    """Solve one frame with these effects; errors [m] of it beside those of the run's models; drawn
    in `page` where one is given.
    """
    run = services.runs.get(name)
    replay = run.replay(sequence)
    if request.frame >= len(replay):
        raise Missing(
            f"{sequence} has the frames 0 to {len(replay) - 1}, not {request.frame}",
            sequence=sequence,
        )
    session = services.sessions.get(request.page) if request.page else None
    effects = [one.model_dump() for one in request.effects]
    moment = services.frame_solver.solve(run, sequence, request.frame, effects, request.tuned)
    if session is not None:
        session.override_frame(FrameOverride(name, sequence, request.frame, moment))
    return {
        "frame": request.frame,
        "distance": finite(moment.distance),
        "distance_raw": finite(replay["distance_raw"][request.frame]),
        "distance_extended": finite(replay["distance_extended"][request.frame]),
        "noise_floor": finite(replay["noise_floor"]),
        "converged": moment.converged,
        "outcome": moment.outcome,
    }


@router.post("/runs/{name}/sequences/{sequence}/live")
def lead(
    name: str, sequence: str, request: LiveRequest, services: CurrentServices
) -> dict[str, Any]:
    """Lead the tool somewhere: push depth [m] and force [N] that it feels there, from wherever it
    was; drawn in `page` if given.
    """
    session = services.sessions.get(request.page) if request.page else None
    effects = [one.model_dump() for one in request.effects]
    hand = InteractiveSession.of(
        request.page or "nobody", services.runs.get(name), sequence, effects, request.tuned
    )
    felt = services.interactive_solver.at(
        hand, request.at, session is not None and session.wants_inside()
    )
    if session is not None:
        session.touch(InteractiveOverride(name, sequence, request.shown, felt))
    return told(felt)


@router.delete("/sessions/{page}/live", status_code=204)
def let_go(page: PageId, services: CurrentServices) -> None:
    """Show the recording again."""
    services.sessions.get(page).touch(None)


@router.websocket("/sessions/{page}/live")
async def led(websocket: WebSocket, page: PageId, services: CurrentServices) -> None:
    """Places in, answers out, drawn in the page: each message is a `LiveRequest` with `run` and
    `sequence`.

    While one is being solved only the newest is kept. The recording is shown again when the
    connection ends.
    """
    hands: dict[str, InteractiveSession] = {}

    def answer(text: str) -> dict[str, Any]:
        try:
            return _led(services, page, hands, LiveMessage.model_validate_json(text))
        except ValidationError as error:
            return {
                "problem": {
                    "kind": "RequestError",
                    "message": error.errors()[0]["msg"],
                    "where": {},
                }
            }
        except PalpateError as error:
            return {"problem": as_dict(error)}

    try:
        await newest_wins(websocket, answer)
    finally:
        with contextlib.suppress(Missing):
            await asyncio.to_thread(services.sessions.get(page).touch, None)


class LiveMessage(LiveRequest):
    """A `LiveRequest` that says of what."""

    run: str
    sequence: str


def _led(
    services: Services, page: str, hands: dict[str, InteractiveSession], request: LiveMessage
) -> dict[str, Any]:
    """Solve, draw and tell; `hands` keeps what was looked up for the connection's last request of
    the same kind.
    """
    key = request.model_dump_json(exclude={"at"})
    if key not in hands:
        hands.clear()
        effects = [one.model_dump() for one in request.effects]
        hands[key] = InteractiveSession.of(
            page, services.runs.get(request.run), request.sequence, effects, request.tuned
        )
    session = services.sessions.open(page)
    felt = services.interactive_solver.at(hands[key], request.at, session.wants_inside())
    session.touch(InteractiveOverride(request.run, request.sequence, request.shown, felt))
    return {
        **told(felt),
        "at": list(request.at),
        "drawn": None if session.picture is None else session.picture.scale(),
    }


def told(felt: InteractiveFrame) -> dict[str, Any]:
    """What was felt, plain values, SI."""
    return {
        "depth": finite(felt.depth),
        "force": finite(felt.force, digits=6),
        "tool": finite(felt.tool),
        "converged": felt.converged,
        "outcome": felt.outcome,
        "seconds": round(felt.seconds, 5),
    }


@router.delete("/sessions/{page}/whatif", status_code=204)
def back(page: PageId, services: CurrentServices) -> None:
    """Show the run's own extended model again."""
    services.sessions.get(page).override_frame(None)
