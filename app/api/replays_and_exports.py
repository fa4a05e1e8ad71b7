"""Replays with chosen effects, and exports of results as files; both are jobs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Response
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from palpate.app.http_errors import Missing
from palpate.app.jobs.job_results import job_out
from palpate.app.schemas import EffectIn, JobOut
from palpate.app.services import CurrentServices, IdempotencyKey
from palpate.app.storage.registration_store import RegistrationStore
from palpate.app.storage.result_store import NAME
from palpate.app.storage.run_store import EXPORTS

__all__ = ["router"]

router = APIRouter(tags=["jobs"])
EXAMPLE: JsonDict = {
    "dataset": "block-01",
    "sequences": ["poke-top-01"],
    "effects": [{"effect": "tool_radius", "parameters": {"radius": 0.006}}],
}


class ReplayRequest(BaseModel):
    """Sequences to replay (all with clouds if empty), the effects to add to the stated setup, and
    an accepted registration.
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
def replay(request: ReplayRequest, services: CurrentServices, key: IdempotencyKey = None) -> JobOut:
    """Check the request, then queue the replay. Its result is a run with the job's id and the
    effects as its extended model.
    """
    from palpate.recording.saved_model import effects_from

    effects = [one.model_dump() for one in request.effects]
    effects_from(effects)
    dataset, settings = services.library.open(request.dataset), services.settings
    for name in request.sequences:
        dataset.sequence(name)
    job_request = {
        "dataset": str(dataset.path),
        "name": request.dataset,
        "runs": str(settings.runs),
        "workers": settings.workers,
        "sequences": list(request.sequences),
        "effects": effects,
        **services.registered(request.dataset, request.registration),
    }
    return job_out(services.jobs.submit("replay", job_request, f"replay-{request.dataset}", key))


@router.post("/exports", status_code=202)
def export(request: ExportRequest, services: CurrentServices, key: IdempotencyKey = None) -> JobOut:
    """Queue the export; the result of the job names the files for GET
    /api/exports/{identity}/{file}.
    """
    if request.run is not None:
        services.runs.get(request.run)
    else:
        store = RegistrationStore(services.settings.runs, request.dataset or "")
        store.request(request.registration or "")
    job_request = {
        "runs": str(services.settings.runs),
        "run": request.run,
        "what": list(request.what),
        "name": request.dataset or request.run,
        "registration": request.registration,
    }
    return job_out(
        services.jobs.submit("export", job_request, f"export-{request.run or request.dataset}", key)
    )


@router.get("/exports/{identity}")
def exported(identity: str, services: CurrentServices) -> dict[str, Any]:
    """The files of a finished export with their sizes in bytes."""
    return {
        "files": {
            path.name: path.stat().st_size
            for path in sorted(_folder(identity, services.settings.runs).iterdir())
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
def exported_file(identity: str, file: str, services: CurrentServices) -> FileResponse:
    """One file of a finished export."""
    path = _folder(identity, services.settings.runs) / file
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
