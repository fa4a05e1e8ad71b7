"""Jobs: list, progress, log, cancel and retry."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import StreamingResponse

from palpate.app.jobs.job_results import job_out
from palpate.app.schemas import JobOut, NoteOut, Notes
from palpate.app.server.pagination import TOTAL, RequestedPage
from palpate.app.services import CurrentServices, Services

__all__ = ["router"]

router = APIRouter(prefix="/jobs", tags=["jobs"])
PAUSE = 0.25
KEEP_ALIVE = 15.0
SHOWN = 50


@router.get("")
def listed(services: CurrentServices, response: Response, page: RequestedPage) -> list[JobOut]:
    """Jobs, the newest first; the header X-Total-Count has their number."""
    response.headers[TOTAL] = str(services.jobs.count())
    return [job_out(job) for job in services.jobs.all(page.most, page.after)]


@router.get("/events")
def events(request: Request, services: CurrentServices) -> StreamingResponse:
    """The newest jobs, at most 50, as server-sent events: at once, and after each change.

    An event `trouble` has the reason why the queue does not work, empty when it works again.
    """
    return StreamingResponse(
        _changes(request, services),
        media_type="text/event-stream",
        headers={"cache-control": "no-cache"},
    )


@router.get("/{identity}")
def one(identity: str, services: CurrentServices) -> JobOut:
    """One job: its progress, or its result."""
    return job_out(services.jobs.get(identity))


@router.post("/{identity}/cancel")
def cancel(identity: str, services: CurrentServices) -> JobOut:
    """Stop a job; 409 if it has ended already."""
    return job_out(services.jobs.cancel(identity))


@router.post("/{identity}/retry", status_code=202)
def retry(identity: str, services: CurrentServices) -> JobOut:
    """Run a failed, cancelled or interrupted job again under its name; 409 if it runs, waits or is
    done.
    """
    return job_out(services.jobs.retry(identity))


@router.get("/{identity}/log")
def notes(
    identity: str, services: CurrentServices, after: Annotated[int, Query(ge=0, le=10**9)] = 0
) -> Notes:
    """Lines of a job's log from the `after`-th on: at most 1000."""
    lines = [
        NoteOut(at=note.at, level=note.level, text=note.text)
        for note in services.jobs.notes(identity, after)
    ]
    return Notes(notes=lines, next=after + len(lines))


async def _changes(request: Request, services: Services) -> AsyncIterator[str]:
    seen, quiet, told = -1, 0.0, ""
    while not request.app.state.ending.is_set() and not await request.is_disconnected():
        version, trouble = services.jobs.version, services.jobs.trouble
        if trouble != told:
            yield f"event: trouble\ndata: {json.dumps(trouble)}\n\n"
            told = trouble
        if version != seen:
            jobs = await asyncio.to_thread(services.jobs.all, SHOWN)
            yield f"data: {json.dumps([job_out(job).model_dump() for job in jobs])}\n\n"
            seen, quiet = version, 0.0
        elif quiet >= KEEP_ALIVE:
            yield ": still here\n\n"
            quiet = 0.0
        await asyncio.sleep(PAUSE)
        quiet += PAUSE
