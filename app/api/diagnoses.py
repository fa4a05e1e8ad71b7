"""Diagnoses: start one, see the list, read a report."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from palpate.app.http_errors import Conflict
from palpate.app.jobs.job_records import JobState
from palpate.app.schemas import DiagnosisRequest, JobOut
from palpate.app.server.pagination import PageOf, part_of
from palpate.app.services import DeskOf, KeyOf

__all__ = ["router"]

router = APIRouter(prefix="/diagnoses", tags=["diagnoses"])


@router.post("", status_code=202)
def start(request: DiagnosisRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Check the dataset completely, then queue its diagnosis; the answer's id names the job now and
    the run later.
    """
    dataset = desk.library.open(request.dataset)
    dataset.validate()
    return JobOut.of(
        desk.diagnose(dataset.path, request.dataset, request.seed, key, request.registration)
    )


@router.get("")
def listed(desk: DeskOf, response: Response, page: PageOf) -> list[JobOut]:
    """Diagnoses that were asked for here, the newest first; the header X-Total-Count says how many
    there are.
    """
    found = [job for job in desk.jobs.all() if job.kind == "diagnosis"]
    return [JobOut.of(job) for job in part_of(found, page, response)]


@router.get("/{identity}")
def one(identity: str, desk: DeskOf) -> JobOut:
    """One diagnosis."""
    return JobOut.of(desk.jobs.get(identity))


@router.get("/{identity}/report")
def report(identity: str, desk: DeskOf) -> dict[str, Any]:
    """The report of a finished diagnosis; 409 while there is none."""
    job = desk.jobs.get(identity)
    if job.state is not JobState.DONE:
        reason = f": {job.error['message']}" if job.error else ""
        raise Conflict(
            f"diagnosis {identity} is {job.state.value} and has no report{reason}",
            job=identity,
            state=job.state.value,
        )
    return desk.runs.get(identity).report
