"""Registration by hand: pairs of points in, fit and ICP out, kept under a name where one is
given."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonValue

from palpate.app.schemas import JobOut, Point
from palpate.app.services import DeskOf, KeyOf
from palpate.app.storage.registration_store import Registrations, register
from palpate.registration.point_pairs import fit_pairs

__all__ = ["router"]

router = APIRouter(prefix="/datasets/{name}/registrations", tags=["registrations"])


PAIRS: list[JsonValue] = [
    {"cloud": [-0.034, 0.012, 0.342], "mesh": [0.0344, 0.0197, 0.0358]},
    {"cloud": [0.021, -0.008, 0.351], "mesh": [-0.0344, 0.0197, 0.0358]},
    {"cloud": [0.03, 0.02, 0.322], "mesh": [-0.0344, -0.0197, 0.0358]},
]


class Pair(BaseModel):
    """One point [m] on the cloud, camera frame, and the same on the mesh, phantom frame."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloud: Point
    mesh: Point


class FitRequest(BaseModel):
    """Pairs to be fitted."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [{"pairs": PAIRS}]}
    )

    pairs: list[Pair] = Field(max_length=100)


class RegistrationRequest(FitRequest):
    """Pairs, and the name to accept the result under; without one nothing is kept."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"pairs": PAIRS, "accept": "by-hand-1"}]},
    )

    accept: str | None = None


@router.get("")
def listed(name: str, desk: DeskOf) -> dict[str, Any]:
    """The names of the registrations kept for a dataset."""
    desk.library.path(name)
    return {"registrations": Registrations(desk.settings.runs).names(name)}


@router.get("/{registration}")
def one(name: str, registration: str, desk: DeskOf) -> dict[str, Any]:
    """One registration as it was accepted."""
    desk.library.path(name)
    return Registrations(desk.settings.runs).get(name, registration)


@router.post("/fit")
def fitted(name: str, request: FitRequest, desk: DeskOf) -> dict[str, Any]:
    """The rigid fit of the pairs alone, with each pair's residual, at once: what to look at while
    clicking.
    """
    desk.library.path(name)
    pairs = request.pairs
    return fit_pairs(
        np.array([pair.cloud for pair in pairs]), np.array([pair.mesh for pair in pairs])
    ).to_json()


class AutomaticRequest(BaseModel):
    """The name to keep it under; a free one without."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [{"accept": "automatic-1"}]}
    )

    accept: str | None = None


@router.post("/automatic", status_code=202)
def automatic(name: str, request: AutomaticRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Queue the automatic registration of a dataset; what it finds is kept under a name like one
    made by hand.
    """
    folder, kept = desk.library.path(name), Registrations(desk.settings.runs)
    if request.accept is not None:
        kept.check_name(name, request.accept)
    said = {
        "dataset": str(folder),
        "name": name,
        "runs": str(desk.settings.runs),
        "accept": request.accept,
    }
    return JobOut.of(desk.jobs.submit("registration", said, f"register-{name}", key))


@router.post("")
def made(name: str, request: RegistrationRequest, desk: DeskOf) -> dict[str, Any]:
    """Fit the pairs, lay the rest cloud against the block from there, and keep it if a name is
    given; a taken name is refused.
    """
    folder, kept = desk.library.path(name), Registrations(desk.settings.runs)
    if request.accept is not None:
        kept.check_name(name, request.accept)
    found = register(
        folder, [pair.cloud for pair in request.pairs], [pair.mesh for pair in request.pairs]
    )
    return found if request.accept is None else kept.save(name, request.accept, found)
