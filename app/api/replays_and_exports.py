"""Replays of a setup of one's own, and files to take away: both are jobs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from palpate.app.http_errors import Missing
from palpate.app.jobs.short_tasks import EXPORTS
from palpate.app.schemas import EffectIn, JobOut
from palpate.app.services import DeskOf, KeyOf
from palpate.app.storage.registration_store import Registrations
from palpate.app.storage.run_store import NAME

__all__ = ["router"]

router = APIRouter(tags=["jobs"])
EXAMPLE: JsonDict = {
    "dataset": "block-01",
    "sequences": ["poke-top-01"],
    "effects": [{"effect": "tool_radius", "parameters": {"radius": 0.006}}],
}


class ReplayRequest(BaseModel):
    """Which sequences (all with clouds without), with which effects in the stated setup, and which
    accepted registration.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [EXAMPLE]}
    )

    dataset: str
    sequences: list[str] = Field(default_factory=list, max_length=1000)
    effects: list[EffectIn] = Field(default_factory=list, max_length=12)
    registration: str | None = None


class ExportRequest(BaseModel):
    """Parts of a run, or a registration of a dataset."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={
            "examples": [{"run": "block-01-20260101-120000-abcd", "what": ["report"]}]
        },
    )

    run: str | None = None
    what: list[Literal["report", "model", "replays"]] = Field(
        default=["report", "model"], min_length=1, max_length=3
    )
    dataset: str | None = None
    registration: str | None = None

    @model_validator(mode="after")
    def _something(self) -> ExportRequest:
        if (self.dataset is None) != (self.registration is None) or (self.run is None) == (
            self.dataset is None
        ):
            raise ValueError("name a run, or a dataset with one of its registrations")
        return self


@router.post("/replays", status_code=202)
def replay(request: ReplayRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Check what is asked, then queue the replay; its result is a run of the job's id, with the
    effects as its extended model.
    """
    from palpate.recording.saved_model import effects_from

    effects = [one.model_dump() for one in request.effects]
    effects_from(effects)
    dataset, settings = desk.library.open(request.dataset), desk.settings
    for name in request.sequences:
        dataset.sequence(name)
    said = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        "sequences": list(request.sequences),
        "effects": effects,
        **desk.registered(request.dataset, request.registration),
    }
    return JobOut.of(desk.jobs.submit("replay", said, f"replay-{request.dataset}", key))


@router.post("/exports", status_code=202)
def export(request: ExportRequest, desk: DeskOf, key: KeyOf = None) -> JobOut:
    """Queue the writing of files; the job's result names them for GET
    /api/exports/{identity}/{file}.
    """
    if request.run is not None:
        desk.runs.get(request.run)
    else:
        Registrations(desk.settings.runs).get(request.dataset or "", request.registration or "")
    said = {
        "runs": str(desk.settings.runs),
        "run": request.run,
        "what": list(request.what),
        "name": request.dataset or request.run,
        "registration": request.registration,
    }
    return JobOut.of(
        desk.jobs.submit("export", said, f"export-{request.run or request.dataset}", key)
    )


@router.get("/exports/{identity}")
def exported(identity: str, desk: DeskOf) -> dict[str, Any]:
    """The files of a finished export, with their sizes in bytes."""
    return {
        "files": {
            path.name: path.stat().st_size
            for path in sorted(_folder(identity, desk.settings.runs).iterdir())
        }
    }


@router.get(
    "/exports/{identity}/{file}",
    response_class=Response,
    responses={
        200: {
            "content": {
                "application/octet-stream": {"schema": {"type": "string", "format": "binary"}}
            }
        }
    },
)
def exported_file(identity: str, file: str, desk: DeskOf) -> FileResponse:
    """One file of a finished export."""
    path = _folder(identity, desk.settings.runs) / file
    if not NAME.fullmatch(file) or not path.is_file():
        raise Missing(f"export {identity} has no file {file}", export=identity, file=file)
    return FileResponse(path, media_type="application/octet-stream", filename=file)


def _folder(identity: str, runs: Path) -> Path:
    path = runs / EXPORTS / identity
    if not NAME.fullmatch(identity) or not path.is_dir():
        raise Missing(
            f"there is no export {identity}; POST /api/exports makes one", export=identity
        )
    return path
