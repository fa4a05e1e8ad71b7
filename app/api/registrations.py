"""Registrations of a dataset: from pairs of points and ICP, or automatic; stored under a name."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonValue

from palpate.app.jobs.job_results import job_out
from palpate.app.schemas import JobOut, Point
from palpate.app.services import ONE_WHOLE_READ, CurrentServices, IdempotencyKey
from palpate.app.storage.registration_store import RegistrationStore, register
from palpate.registration.point_pairs import fit_pairs

__all__ = ["router"]

router = APIRouter(prefix="/datasets/{name}/registrations", tags=["registrations"])


PAIRS: list[JsonValue] = [
    {"cloud": [-0.034, 0.012, 0.342], "mesh": [0.0344, 0.0197, 0.0358]},
    {"cloud": [0.021, -0.008, 0.351], "mesh": [-0.0344, 0.0197, 0.0358]},
    {"cloud": [0.03, 0.02, 0.322], "mesh": [-0.0344, -0.0197, 0.0358]},
]


class PointPair(BaseModel):
    """The same point [m] on the cloud, camera frame, and on the mesh, phantom frame."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloud: Point
    mesh: Point


class FitRequest(BaseModel):
    """Pairs of points to fit."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [{"pairs": PAIRS}]}
    )

    pairs: list[PointPair] = Field(max_length=100)


class RegistrationRequest(FitRequest):
    """Pairs of points, and the name to store the result under; without a name it is not stored."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"pairs": PAIRS, "accept": "by-hand-1"}]},
    )

    accept: str | None = None


@router.get("")
def listed(name: str, services: CurrentServices) -> dict[str, Any]:
    """Names of the registrations of a dataset."""
    services.library.path(name)
    return {"registrations": RegistrationStore(services.settings.runs, name).names()}


@router.get("/{registration}")
def one(name: str, registration: str, services: CurrentServices) -> dict[str, Any]:
    """One stored registration."""
    services.library.path(name)
    return RegistrationStore(services.settings.runs, name).request(registration)


@router.post("/fit")
def fitted(name: str, request: FitRequest, services: CurrentServices) -> dict[str, Any]:
    """Rigid fit of the pairs alone, with the residual of each pair; answers at once."""
    services.library.path(name)
    pairs = request.pairs
    return fit_pairs(
        np.array([pair.cloud for pair in pairs]), np.array([pair.mesh for pair in pairs])
    ).to_json()


class AutomaticRequest(BaseModel):
    """The name to store the registration under; without one a free name is used."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [{"accept": "automatic-1"}]}
    )

    accept: str | None = None


@router.post("/automatic", status_code=202)
def automatic(
    name: str, request: AutomaticRequest, services: CurrentServices, key: IdempotencyKey = None
) -> JobOut:
    """Queue the automatic registration of a dataset; the result is stored under a name."""
    folder, store = services.library.path(name), RegistrationStore(services.settings.runs, name)
    if request.accept is not None and not services.jobs.knows(key):
        store.check_name(request.accept)
    job_request = {
        "dataset": str(folder),
        "name": name,
        "runs": str(services.settings.runs),
        "accept": request.accept,
    }
    return job_out(services.jobs.submit("registration", job_request, f"register-{name}", key))


@router.post("", dependencies=[ONE_WHOLE_READ])
def made(name: str, request: RegistrationRequest, services: CurrentServices) -> dict[str, Any]:
    """Fit the pairs, refine by ICP, and store the result if a name is given; 409 for a name that is
    taken.
    """
    folder, store = services.library.path(name), RegistrationStore(services.settings.runs, name)
    if request.accept is not None:
        store.check_name(request.accept)
    result = register(
        folder, [pair.cloud for pair in request.pairs], [pair.mesh for pair in request.pairs]
    )
    return result if request.accept is None else store.save(request.accept, result)
