"""Evaluations: errors of the models and networks on the test sequences of a dataset."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

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
from palpate.app.storage.evaluation_store import EvaluationStore, networks_for
from palpate.app.storage.training_store import TrainingStore

__all__ = ["EvaluationRequest", "router"]

router = APIRouter(prefix="/evaluations", tags=["evaluations"])
EXAMPLE: JsonDict = {"dataset": "block-01"}


class EvaluationRequest(BaseModel):
    """A dataset, a run whose extended model is evaluated too, and trainings.

    Without named trainings the newest suitable ones are used. With the feedback `follow` the
    simulation moves the points that a network does not see.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [EXAMPLE]}
    )

    dataset: str
    run: str | None = None
    trainings: list[str] = Field(default_factory=list, max_length=4)
    feedback: Literal["none", "follow"] = "none"
    seed: int = Field(default=0, ge=0, lt=2**31)


@router.post("", status_code=202)
def start(
    request: EvaluationRequest, services: CurrentServices, key: IdempotencyKey = None
) -> JobOut:
    """Check the request, then queue it; the id of the answer names job and evaluation."""
    dataset, settings = services.library.open(request.dataset), services.settings
    if request.run is not None:
        services.runs.get(request.run)
    networks_for(TrainingStore(settings.runs), dataset.path, request.run, request.trainings)
    job_request = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        **request.model_dump(include={"run", "trainings", "feedback", "seed"}),
    }
    label = f"evaluation-{request.dataset}"
    return job_out(services.jobs.submit("evaluation", job_request, label, key))


@router.get("")
def listed(
    services: CurrentServices, response: Response, page: RequestedPage
) -> list[dict[str, Any]]:
    """Evaluations, the newest first, each with its job where that is still recorded.

    The header X-Total-Count has their number.
    """
    store = EvaluationStore(services.settings.runs)
    rows = paginate(names_and_jobs(store, services.jobs), page, response)
    return [listed_result(store, name, job, services.library) for name, job in rows]


@router.get("/{identity}")
def one(identity: str, services: CurrentServices) -> dict[str, Any]:
    """One evaluation: its job, and the errors once it has ended."""
    store = EvaluationStore(services.settings.runs)
    return result_and_job(store, identity, job_of(store, identity, services.jobs), services.library)


@router.post("/{identity}/cancel")
def cancel(identity: str, services: CurrentServices) -> JobOut:
    """Stop it. 409 if it has ended already."""
    return cancel_job(EvaluationStore(services.settings.runs), identity, services.jobs)
