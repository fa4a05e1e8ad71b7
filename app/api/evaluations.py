"""Evaluations: the ladder of a dataset's test sequences."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from palpate.app.schemas import JobOut
from palpate.app.server.pagination import PageOf, part_of
from palpate.app.services import DeskOf, KeyOf
from palpate.app.storage.evaluation_store import Evaluations, networks_for
from palpate.app.storage.training_store import Trainings

__all__ = ["EvaluationRequest", "router"]

router = APIRouter(prefix="/evaluations", tags=["evaluations"])
EXAMPLE: JsonDict = {"dataset": "block-01"}


class EvaluationRequest(BaseModel):
    """Which dataset, beside which run's extended model, with which trainings; the newest ones where
    none is named.

    With the feedback `follow` the simulation answers for the points that a network does not see.
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
def start(request: EvaluationRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Check what is asked, then queue it; the answer's id names job and evaluation."""
    dataset, settings = desk.library.open(request.dataset), desk.settings
    if request.run is not None:
        desk.runs.get(request.run)
    networks_for(Trainings(settings.runs), dataset.path, request.run, request.trainings)
    said = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        **request.model_dump(include={"run", "trainings", "feedback", "seed"}),
    }
    return JobOut.of(desk.jobs.submit("evaluation", said, f"evaluation-{request.dataset}", key))


@router.get("")
def listed(desk: DeskOf, response: Response, page: PageOf) -> list[dict[str, Any]]:
    """Evaluations, the newest first, each with its job where that is still known; X-Total-Count
    says how many there are.
    """
    return list(part_of(Evaluations(desk.settings.runs).listed(desk), page, response))


@router.get("/{identity}")
def one(identity: str, desk: DeskOf) -> dict[str, Any]:
    """One evaluation: its job, and the ladder once it has ended."""
    return Evaluations(desk.settings.runs).one(identity, desk)


@router.post("/{identity}/cancel")
def cancel(identity: str, desk: DeskOf) -> JobOut:
    """Stop it. 409 if it has ended already."""
    return Evaluations(desk.settings.runs).cancel(identity, desk)
