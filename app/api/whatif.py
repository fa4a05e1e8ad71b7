"""Frames solved again with chosen effects, and interactive replays."""

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


class LiveMessage(LiveRequest):
    """A message of the live websocket: a `LiveRequest` with its run and sequence."""

    run: str
    sequence: str


@router.get("/runs/{name}/sequences/{sequence}/whatif")
def beginnings(name: str, sequence: str, services: CurrentServices) -> dict[str, Any]:
    """Starting points for changes: the effects of the model, and an instance of every effect of the
    catalogue with a finite size.

    `impossible` has the effects that this setup cannot have, each with the reason; `spans` the
    values (SI) between which numbers make sense in this phantom, such as places.
    """
    run = services.runs.get(name)
    run.replay(sequence)
    return {
        "model": run.model.get("effects", []),
        **services.frame_solver.beginnings(run, sequence),
    }


@router.post("/runs/{name}/sequences/{sequence}/whatif")
def solve(
    name: str, sequence: str, request: WhatIfRequest, services: CurrentServices
) -> dict[str, Any]:
    """Solve one frame with these effects; its errors [m] and those of the run's models.

    The solution is drawn in `page` if one is given.
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
    solution = services.frame_solver.solve(run, sequence, request.frame, effects, request.tuned)
    if session is not None:
        session.override_frame(FrameOverride(name, sequence, request.frame, solution))
    return {
        "frame": request.frame,
        "distance": finite(solution.distance),
        "distance_raw": finite(replay["distance_raw"][request.frame]),
        "distance_extended": finite(replay["distance_extended"][request.frame]),
        "noise_floor": finite(replay["noise_floor"]),
        "converged": solution.converged,
        "outcome": solution.outcome,
        "notes": list(solution.notes),
    }


@router.delete("/sessions/{page}/whatif", status_code=204)
def show_model(page: PageId, services: CurrentServices) -> None:
    """Show the run's own extended model again."""
    services.sessions.get(page).override_frame(None)


@router.post("/runs/{name}/sequences/{sequence}/live")
def solve_live(
    name: str, sequence: str, request: LiveRequest, services: CurrentServices
) -> dict[str, Any]:
    """Move the tool to a place: push depth [m] and force [N] there.

    The solution is drawn in `page` if one is given.
    """
    session = services.sessions.get(request.page) if request.page else None
    replay = _interactive(request.page or "nobody", name, sequence, request, services)
    inside = session is not None and session.needs_inside()
    solution = services.interactive_solver.at(replay, request.at, inside)
    if session is not None:
        session.show_interactive(InteractiveOverride(name, sequence, request.shown, solution))
    return _live_values(solution)


@router.delete("/sessions/{page}/live", status_code=204)
def end_live(page: PageId, services: CurrentServices) -> None:
    """Show the recording again."""
    services.sessions.get(page).show_interactive(None)


@router.websocket("/sessions/{page}/live")
async def live(websocket: WebSocket, page: PageId, services: CurrentServices) -> None:
    """Answer each `LiveMessage` and draw its solution in the page.

    Messages that arrive while one is being solved replace each other. The recording is shown again
    when the connection ends.
    """
    replays: dict[str, InteractiveSession] = {}

    def answer(text: str) -> dict[str, Any]:
        try:
            message = LiveMessage.model_validate_json(text)
            return _solve_message(services, page, replays, message)
        except ValidationError as error:
            problem = {"kind": "RequestError", "message": error.errors()[0]["msg"], "where": {}}
            return {"problem": problem}
        except PalpateError as error:
            return {"problem": as_dict(error)}

    try:
        await newest_wins(websocket, answer)
    finally:
        with contextlib.suppress(Missing):
            await asyncio.to_thread(services.sessions.get(page).show_interactive, None)


def _solve_message(
    services: Services, page: str, replays: dict[str, InteractiveSession], message: LiveMessage
) -> dict[str, Any]:
    """Solve and draw; `replays` caches the replay of the connection's last message."""
    key = message.model_dump_json(exclude={"at"})
    if key not in replays:
        replays.clear()
        replays[key] = _interactive(page, message.run, message.sequence, message, services)
    session = services.sessions.open(page)
    solution = services.interactive_solver.at(replays[key], message.at, session.needs_inside())
    session.show_interactive(
        InteractiveOverride(message.run, message.sequence, message.shown, solution)
    )
    return {
        **_live_values(solution),
        "at": list(message.at),
        "drawn": None if session.picture is None else session.picture.scale(),
    }


def _interactive(
    page: str, run: str, sequence: str, request: LiveRequest, services: Services
) -> InteractiveSession:
    effects = [one.model_dump() for one in request.effects]
    return InteractiveSession.of(page, services.runs.get(run), sequence, effects, request.tuned)


def _live_values(solution: InteractiveFrame) -> dict[str, Any]:
    """Push depth, force and state of a solution as plain values, SI."""
    return {
        "depth": finite(solution.depth),
        "force": finite(solution.force, digits=6),
        "tool": finite(solution.tool),
        "converged": solution.converged,
        "outcome": solution.outcome,
        "seconds": round(solution.seconds, 5),
    }
