"""Sweeps: start one, follow its points as they come, stop it."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat
from pydantic.config import JsonDict

from palpate.app.http_errors import Missing
from palpate.app.schemas import JobOut
from palpate.app.server.pagination import PageOf, part_of
from palpate.app.services import Desk, DeskOf, KeyOf
from palpate.app.storage.sweep_store import Sweeps
from palpate.sweep.sweep_spec import MOST_POINTS, Measure, Method, SweepSpec

__all__ = ["router"]

router = APIRouter(prefix="/sweeps", tags=["sweeps"])
EXAMPLE: JsonDict = {
    "dataset": "block-01",
    "parameters": [{"parameter": "poisson_ratio.nu", "low": 0.3, "high": 0.49}],
    "steps": 7,
}


class SweptParameter(BaseModel):
    """One parameter by `effect.parameter` of GET /api/effects, and between which values it moves
    (SI).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    parameter: str
    low: FiniteFloat
    high: FiniteFloat


class SweepRequest(BaseModel):
    """What is swept, over which clouds, and how; see `palpate.sweep.sweep_spec.SweepSpec`."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [EXAMPLE]}
    )

    dataset: str
    parameters: list[SweptParameter] = Field(min_length=1, max_length=12)
    fixed: dict[str, FiniteFloat | str] = Field(default_factory=dict, max_length=40)
    method: Method = "grid"
    steps: int = Field(default=7, ge=2, le=1000)
    levels: int = Field(default=1, ge=1, le=12)
    points: int = Field(default=40, ge=1, le=MOST_POINTS)
    sequences: list[str] = Field(default_factory=list, max_length=1000)
    frames: int = Field(default=8, ge=1, le=1000)
    measure: Measure = "distance"
    seed: int = Field(default=0, ge=0, lt=2**31)
    registration: str | None = None


@router.post("", status_code=202)
def start(request: SweepRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Check what is asked, then queue it; the answer's id names job and sweep."""
    asked = SweepSpec.from_json(request.model_dump(exclude={"dataset", "registration"}))
    dataset = desk.library.open(request.dataset)
    for name in asked.sequences:
        dataset.sequence(name)
    settings = desk.settings
    said = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        "scheduler": settings.scheduler,
        "sweep": asked.to_json(),
        **desk.registered(request.dataset, request.registration),
    }
    return JobOut.of(desk.jobs.submit("sweep", said, f"sweep-{request.dataset}", key))


@router.get("")
def listed(desk: DeskOf, response: Response, page: PageOf) -> list[dict[str, Any]]:
    """Sweeps, the newest first, each with its job where that is still known; X-Total-Count says how
    many there are.
    """
    kept = Sweeps(desk.settings.runs)
    jobs = {job.id: JobOut.of(job).model_dump() for job in desk.jobs.all() if job.kind == "sweep"}
    names = [*(name for name in jobs if not kept.begun(name)), *kept.names()]
    return [
        {"id": name, "job": jobs.get(name), "begun": kept.begun(name)}
        for name in part_of(names, page, response)
    ]


@router.get("/{identity}")
def one(identity: str, desk: DeskOf) -> dict[str, Any]:
    """One sweep: its job, what was asked, and what it found once it has ended."""
    kept, job = Sweeps(desk.settings.runs), _job(identity, desk)
    if job is None and not kept.begun(identity):
        raise Missing(
            f"there is no sweep {identity}; GET /api/sweeps lists those there are", sweep=identity
        )
    begun = kept.begun(identity)
    asked = kept.request(identity) if begun else None
    return {
        "id": identity,
        "job": job,
        "request": asked,
        "summary": kept.summary(identity) if begun else None,
    }


@router.get("/{identity}/points")
def points(
    identity: str,
    desk: DeskOf,
    after: Annotated[int, Query(ge=0, le=10**9)] = 0,
    most: Annotated[int, Query(ge=1, le=1000)] = 1000,
) -> dict[str, Any]:
    """Points in the order in which they ended, from the `after`-th on; `next` is what to ask for
    next time.
    """
    kept, job = Sweeps(desk.settings.runs), _job(identity, desk)
    if job is None:
        kept.request(identity)
    found = kept.points(identity)[after : after + most] if kept.begun(identity) else []
    return {"points": found, "next": after + len(found), "job": job}


@router.post("/{identity}/cancel")
def cancel(identity: str, desk: DeskOf) -> JobOut:
    """Stop it; the points that have ended stay. 409 if it has ended already."""
    if _job(identity, desk) is None:
        raise Missing(f"there is no sweep {identity} that could be stopped", sweep=identity)
    return JobOut.of(desk.jobs.cancel(identity))


def _job(identity: str, desk: Desk) -> dict[str, Any] | None:
    """The job of a sweep, if its record is there."""
    try:
        job = desk.jobs.get(identity)
    except Missing:
        return None
    return JobOut.of(job).model_dump() if job.kind == "sweep" else None
