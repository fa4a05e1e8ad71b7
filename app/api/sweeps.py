"""Sweeps: start one, follow its points, stop it."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat
from pydantic.config import JsonDict

from palpate.app.http_errors import Missing
from palpate.app.jobs.job_results import (
    cancel_job,
    job_of,
    job_out,
    listed_result,
    names_and_jobs,
    result_and_job,
)
from palpate.app.schemas import JobOut
from palpate.app.server.pagination import RequestedPage, paginate
from palpate.app.services import CurrentServices, IdempotencyKey
from palpate.app.storage.sweep_store import SweepStore
from palpate.sweep.sweep_spec import MOST_POINTS, Measure, Method, SweepSpec

__all__ = ["router"]

router = APIRouter(prefix="/sweeps", tags=["sweeps"])
EXAMPLE: JsonDict = {
    "dataset": "block-01",
    "parameters": [{"parameter": "poisson_ratio.nu", "low": 0.3, "high": 0.49}],
    "steps": 7,
}


class SweptParameter(BaseModel):
    """One parameter as `effect.parameter` of GET /api/effects, and its range (SI)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    parameter: str
    low: FiniteFloat
    high: FiniteFloat


class SweepRequest(BaseModel):
    """Parameters, clouds and method of a sweep; see `palpate.sweep.sweep_spec.SweepSpec`."""

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
def start(request: SweepRequest, services: CurrentServices, key: IdempotencyKey = None) -> JobOut:
    """Check the request, then queue it; the id of the answer names job and sweep."""
    spec = SweepSpec.from_json(request.model_dump(exclude={"dataset", "registration"}))
    dataset = services.library.open(request.dataset)
    for name in spec.sequences:
        dataset.sequence(name)
    settings = services.settings
    job_request = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        "scheduler": settings.scheduler,
        "sweep": spec.to_json(),
        **services.registered(request.dataset, request.registration),
    }
    return job_out(services.jobs.submit("sweep", job_request, f"sweep-{request.dataset}", key))


@router.get("")
def listed(
    services: CurrentServices, response: Response, page: RequestedPage
) -> list[dict[str, Any]]:
    """Sweeps, the newest first, each with its job where that is still recorded.

    The header X-Total-Count has their number.
    """
    store = SweepStore(services.settings.runs)
    rows = paginate(names_and_jobs(store, services.jobs), page, response)
    return [
        {
            "id": name,
            "job": job,
            "begun": store.has_begun(name),
            "data_changed": listed_result(store, name, job, services.library)["data_changed"],
        }
        for name, job in rows
    ]


@router.get("/{identity}")
def one(identity: str, services: CurrentServices) -> dict[str, Any]:
    """One sweep: its job, the request, and the summary once it has ended."""
    store = SweepStore(services.settings.runs)
    return result_and_job(store, identity, job_of(store, identity, services.jobs), services.library)


@router.get("/{identity}/points")
def points(
    identity: str,
    services: CurrentServices,
    after: Annotated[int, Query(ge=0, le=10**9)] = 0,
    most: Annotated[int, Query(ge=1, le=1000)] = 1000,
) -> dict[str, Any]:
    """Finished points in the order of their ends, from number `after` on.

    `next` is the value of `after` for the next request.
    """
    store = SweepStore(services.settings.runs)
    job = job_of(store, identity, services.jobs)
    if job is None and not store.has_begun(identity):
        raise store.missing(identity)
    begun = store.has_begun(identity)
    rows = store.points(identity)[after : after + most] if begun else []
    return {"points": rows, "next": after + len(rows), "job": job}


@router.get("/{identity}/points/{number}/replay")
def replay_of_point(identity: str, number: int, services: CurrentServices) -> dict[str, Any]:
    """The body of a POST /api/replays that replays the swept sequences with the values of a point;
    the other parameters of its effects are as stated, or as the sweep fixed them.
    """
    from palpate.registration.registration import unregistered_setup

    store = SweepStore(services.settings.runs)
    if not store.has_begun(identity):
        raise store.missing(identity)
    request = store.request(identity)
    values = next(
        (row["values"] for row in store.points(identity) if row["number"] == number), None
    )
    if values is None:
        raise Missing(
            f"sweep {identity} has no point {number}; GET its points for those it has",
            sweep=identity,
            number=number,
        )
    spec = SweepSpec.from_json(request)
    setup = unregistered_setup(services.library.open(request["dataset"]))
    return {
        "dataset": request["dataset"],
        "sequences": list(spec.sequences),
        "effects": [one.to_json() for one in spec.space.effects(setup, values)],
        "registration": request.get("registration"),
    }


@router.post("/{identity}/cancel")
def cancel(identity: str, services: CurrentServices) -> JobOut:
    """Stop it; its finished points stay. 409 if it has ended already."""
    return cancel_job(SweepStore(services.settings.runs), identity, services.jobs)
