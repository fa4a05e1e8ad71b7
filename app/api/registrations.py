"""Registration by hand: pairs of points in, fit and ICP out, kept under a name where one is given."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from app.desk import DeskOf
from app.problems import Conflict
from app.registrations import Registrations, register
from app.schemas import Point
from core.registration.pairs import fit_pairs

__all__ = ["router"]

router = APIRouter(prefix="/datasets/{name}/registrations", tags=["registrations"])


class Pair(BaseModel):
    """One point [m] on the cloud, camera frame, and the same on the mesh, phantom frame."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cloud: Point
    mesh: Point


class FitRequest(BaseModel):
    """Pairs to be fitted."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    pairs: list[Pair] = Field(max_length=100)


class RegistrationRequest(FitRequest):
    """Pairs, and the name to accept the result under; without one nothing is kept."""

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
    """The rigid fit of the pairs alone, with each pair's residual, at once: what to look at while clicking."""
    desk.library.path(name)
    pairs = request.pairs
    return fit_pairs(np.array([pair.cloud for pair in pairs]), np.array([pair.mesh for pair in pairs])).to_json()


@router.post("")
def made(name: str, request: RegistrationRequest, desk: DeskOf) -> dict[str, Any]:
    """Fit the pairs, lay the rest cloud against the block from there, and keep it if a name is given; a taken name is refused."""
    folder, kept = desk.library.path(name), Registrations(desk.settings.runs)
    if request.accept is not None and request.accept in kept.names(name):
        raise Conflict(f"{name} has a registration {request.accept} already: choose another name", registration=request.accept)
    found = register(folder, [pair.cloud for pair in request.pairs], [pair.mesh for pair in request.pairs])
    return found if request.accept is None else kept.save(name, request.accept, found)
