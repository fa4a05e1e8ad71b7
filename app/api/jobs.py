"""Jobs: how far they are, live, and how to stop them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator

from fastapi import APIRouter, Request
from fastapi.responses import StreamingResponse

from app.desk import Desk, DeskOf
from app.schemas import JobOut

__all__ = ["router"]

router = APIRouter(prefix="/jobs", tags=["jobs"])
PAUSE = 0.25
KEEP_ALIVE = 15.0


@router.get("")
def listed(desk: DeskOf) -> list[JobOut]:
    """All jobs, the newest first."""
    return [JobOut.of(job) for job in desk.jobs.all()]


@router.get("/events")
def events(request: Request, desk: DeskOf) -> StreamingResponse:
    """The list of jobs as server-sent events: at once, and after each change."""
    return StreamingResponse(_changes(request, desk), media_type="text/event-stream", headers={"cache-control": "no-cache"})


@router.get("/{identity}")
def one(identity: str, desk: DeskOf) -> JobOut:
    """One job."""
    return JobOut.of(desk.jobs.get(identity))


@router.post("/{identity}/cancel")
def cancel(identity: str, desk: DeskOf) -> JobOut:
    """Stop a job; 409 if it has ended already."""
    return JobOut.of(desk.jobs.cancel(identity))


async def _changes(request: Request, desk: Desk) -> AsyncIterator[str]:
    seen, quiet = -1, 0.0
    while not request.app.state.ending.is_set() and not await request.is_disconnected():
        version = desk.jobs.version
        if version != seen:
            jobs = await asyncio.to_thread(desk.jobs.all)
            yield f"data: {json.dumps([JobOut.of(job).model_dump() for job in jobs])}\n\n"
            seen, quiet = version, 0.0
        elif quiet >= KEEP_ALIVE:
            yield ": still here\n\n"
            quiet = 0.0
        await asyncio.sleep(PAUSE)
        quiet += PAUSE
