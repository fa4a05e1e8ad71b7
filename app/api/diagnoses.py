"""Diagnoses: start one, list them, read a report."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from palpate.app.http_errors import Conflict
from palpate.app.jobs.job_records import JobState
from palpate.app.jobs.job_results import job_out
from palpate.app.schemas import DiagnosisRequest, JobOut
from palpate.app.server.pagination import RequestedPage, paginate
from palpate.app.services import ONE_WHOLE_READ, CurrentServices, IdempotencyKey

__all__ = ["router"]

router = APIRouter(prefix="/diagnoses", tags=["diagnoses"])


@router.post("", status_code=202, dependencies=[ONE_WHOLE_READ])
def start(
    request: DiagnosisRequest, services: CurrentServices, key: IdempotencyKey = None
) -> JobOut:
    """Check the dataset completely, then queue its diagnosis; the id of the answer names the job
    and later the run.
    """
    dataset = services.library.open(request.dataset)
    dataset.validate()
    return job_out(
        services.diagnose(
            dataset.path,
            request.dataset,
            request.seed,
            key,
            request.registration,
            request.tolerance,
        )
    )


@router.get("")
def listed(services: CurrentServices, response: Response, page: RequestedPage) -> list[JobOut]:
    """Diagnoses that were requested here, the newest first; the header X-Total-Count has their
    number.
    """
    diagnoses = [job for job in services.jobs.all() if job.kind == "diagnosis"]
    return [job_out(job) for job in paginate(diagnoses, page, response)]


@router.get("/{identity}")
def one(identity: str, services: CurrentServices) -> JobOut:
    """One diagnosis."""
    return job_out(services.jobs.get(identity))


@router.get("/{identity}/report")
def report(identity: str, services: CurrentServices) -> dict[str, Any]:
    """The report of a finished diagnosis; 409 while there is none."""
    job = services.jobs.get(identity)
    if job.state is not JobState.DONE:
        reason = f": {job.error['message']}" if job.error else ""
        raise Conflict(
            f"diagnosis {identity} is {job.state.value} and has no report{reason}",
            job=identity,
            state=job.state.value,
        )
    return services.runs.get(identity).report
