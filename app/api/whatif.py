"""What if: a frame solved again with causes of one's own choice."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from app.desk import DeskOf
from app.problems import Missing
from app.relay import PageId
from app.schemas import WhatIfRequest
from app.sessions import Trial
from app.summaries import finite

__all__ = ["router"]

router = APIRouter(tags=["what if"])


@router.get("/runs/{name}/sequences/{sequence}/whatif")
def beginnings(name: str, sequence: str, desk: DeskOf) -> dict[str, Any]:
    """The model's effects, and a finite size of every effect of the catalogue, from which to go on by hand."""
    run = desk.runs.get(name)
    run.replay(sequence)
    return {"model": run.model.get("effects", []), "beginnings": desk.whatifs.beginnings(run, sequence)}


@router.post("/runs/{name}/sequences/{sequence}/whatif")
def solve(name: str, sequence: str, request: WhatIfRequest, desk: DeskOf) -> dict[str, Any]:
    """Solve one frame with these effects; errors [m] of it beside those of the run's models; drawn in `page` where one is given."""
    run = desk.runs.get(name)
    replay = run.replay(sequence)
    if request.frame >= len(replay):
        raise Missing(f"{sequence} has the frames 0 to {len(replay) - 1}, not {request.frame}", sequence=sequence)
    session = desk.sessions.get(request.page) if request.page else None
    effects = [one.model_dump() for one in request.effects]
    moment = desk.whatifs.solve(run, sequence, request.frame, effects, request.tuned)
    if session is not None:
        session.try_out(Trial(name, sequence, request.frame, moment))
    return {
        "frame": request.frame,
        "distance": finite(moment.distance),
        "distance_raw": finite(replay["distance_raw"][request.frame]),
        "distance_extended": finite(replay["distance_extended"][request.frame]),
        "noise_floor": finite(replay["noise_floor"]),
        "converged": moment.converged,
        "outcome": moment.outcome,
    }


@router.delete("/sessions/{page}/whatif", status_code=204)
def back(page: PageId, desk: DeskOf) -> None:
    """Show the run's own extended model again."""
    desk.sessions.get(page).try_out(None)
