"""Trainings of the correction network: start one, follow its error by epoch, stop it."""

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
from palpate.app.storage.training_store import TrainingStore
from palpate.foundation.errors import CorrectionError

__all__ = ["TrainingRequest", "router"]

router = APIRouter(prefix="/trainings", tags=["trainings"])
EXAMPLE: JsonDict = {"dataset": "block-01", "kind": "unet2d", "epochs": 20}


class TrainingRequest(BaseModel):
    """A training on the raw model of a dataset, or on the extended model of a run; see
    `palpate.correction.training_spec`.

    `trust` limits the correction along each axis [voxels], `hold` is the weight [1/mm] that keeps
    hidden vertices near the simulation, of `every` clouds one is used for training.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [EXAMPLE]}
    )

    dataset: str
    run: str | None = None
    kind: Literal["unet2d", "unet3d", "graph"] = "unet2d"
    features: list[int] = Field(default=[64, 128, 256], min_length=1, max_length=6)
    trust: float = Field(default=0.5, gt=0, le=10)
    inputs: list[Literal["pose", "velocity", "force"]] = Field(
        default=["pose"], min_length=1, max_length=3
    )
    distance: Literal["chamfer", "symmetric", "hausdorff"] = "chamfer"
    hold: float = Field(default=1.0, ge=0, le=1e6)
    rate: float = Field(default=5e-4, ge=1e-7, le=1)
    batch: int = Field(default=64, ge=1, le=4096)
    epochs: int = Field(default=40, ge=1, le=100_000)
    patience: int = Field(default=6, ge=1, le=100_000)
    every: int = Field(default=1, ge=1, le=10_000)
    seed: int = Field(default=0, ge=0, lt=2**31)

    def plan(self) -> dict[str, Any]:
        """The request as `palpate.evaluation.train_network.TrainingPlan` reads it."""
        if any(not 1 <= width <= 4096 for width in self.features):
            raise CorrectionError(f"features = {self.features}; expected 1 to 4096", key="features")
        network = {
            "kind": self.kind,
            "features": self.features,
            "trust": self.trust,
            "inputs": list(dict.fromkeys(self.inputs)),
        }
        plain = self.model_dump(
            include={"distance", "hold", "rate", "batch", "epochs", "patience", "seed"}
        )
        return {"spec": {"network": network, **plain}, "every": self.every}


@router.post("", status_code=202)
def start(
    request: TrainingRequest, services: CurrentServices, key: IdempotencyKey = None
) -> JobOut:
    """Check the request, then queue it; the id of the answer names job and training. A retry
    resumes it.
    """
    dataset, settings = services.library.open(request.dataset), services.settings
    if request.run is not None:
        services.runs.get(request.run)
    job_request = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        "run": request.run,
        "training": request.plan(),
    }
    label = f"training-{request.dataset}"
    return job_out(services.jobs.submit("training", job_request, label, key))


@router.get("")
def listed(
    services: CurrentServices, response: Response, page: RequestedPage
) -> list[dict[str, Any]]:
    """Trainings, the newest first, each with its job where that is still recorded.

    The header X-Total-Count has their number.
    """
    store = TrainingStore(services.settings.runs)
    rows = paginate(names_and_jobs(store, services.jobs), page, response)
    return [listed_result(store, name, job, services.library) for name, job in rows]


@router.get("/{identity}")
def one(identity: str, services: CurrentServices) -> dict[str, Any]:
    """One training: its job, the request, the summary once it has ended, and the history.

    The history has loss, validation error [mm] and learning rate of each finished epoch.
    """
    store = TrainingStore(services.settings.runs)
    result = result_and_job(
        store, identity, job_of(store, identity, services.jobs), services.library
    )
    return {**result, "history": store.history(identity)}


@router.post("/{identity}/cancel")
def cancel(identity: str, services: CurrentServices) -> JobOut:
    """Stop it; a retry resumes it. 409 if it has ended already."""
    return cancel_job(TrainingStore(services.settings.runs), identity, services.jobs)
