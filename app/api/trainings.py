"""Trainings of the correction network: start one, follow its error epoch by epoch, stop it."""

from __future__ import annotations

from typing import Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from palpate.app.schemas import JobOut
from palpate.app.server.pagination import PageOf, part_of
from palpate.app.services import DeskOf, KeyOf
from palpate.app.storage.training_store import Trainings
from palpate.foundation.errors import CorrectionError

__all__ = ["TrainingRequest", "router"]

router = APIRouter(prefix="/trainings", tags=["trainings"])
EXAMPLE: JsonDict = {"dataset": "block-01", "kind": "unet2d", "epochs": 20}


class TrainingRequest(BaseModel):
    """What is trained on which dataset, on the stated model or on the extended one of a run; see
    `palpate.correction.training_spec`.

    `trust` is how far the simulation may be corrected along each axis [voxels], `hold` the weight
    that keeps hidden vertices near it [1/mm], `every` each how many clouds one is learned from.
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

    def asked(self) -> dict[str, Any]:
        """As `palpate.evaluation.train_network.TrainingPlan` has it."""
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
def start(request: TrainingRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Check what is asked, then queue it; the answer's id names job and training. Retried, it goes
    on where it was.
    """
    dataset, settings = desk.library.open(request.dataset), desk.settings
    if request.run is not None:
        desk.runs.get(request.run)
    said = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        "run": request.run,
        "training": request.asked(),
    }
    return JobOut.of(desk.jobs.submit("training", said, f"training-{request.dataset}", key))


@router.get("")
def listed(desk: DeskOf, response: Response, page: PageOf) -> list[dict[str, Any]]:
    """Trainings, the newest first, each with its job where that is still known; X-Total-Count says
    how many there are.
    """
    return list(part_of(Trainings(desk.settings.runs).listed(desk), page, response))


@router.get("/{identity}")
def one(identity: str, desk: DeskOf) -> dict[str, Any]:
    """One training: its job, what was asked, loss, validation error [mm] and rate of each epoch so
    far, and what came of it.
    """
    trainings = Trainings(desk.settings.runs)
    return {**trainings.one(identity, desk), "history": trainings.history(identity)}


@router.post("/{identity}/cancel")
def cancel(identity: str, desk: DeskOf) -> JobOut:
    """Stop it; retried, it goes on where it was. 409 if it has ended already."""
    return Trainings(desk.settings.runs).cancel(identity, desk)
