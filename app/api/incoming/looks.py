"""Looks at recordings and datasets before any job, and the import of what was looked at."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from palpate.app.api.incoming.imports import readable_path, refuse_taken
from palpate.app.http_errors import Conflict, Missing
from palpate.app.jobs.job_results import job_of, job_out, names_and_jobs
from palpate.app.schemas import JobOut
from palpate.app.server.pagination import RequestedPage, paginate
from palpate.app.services import CurrentServices, IdempotencyKey, Services
from palpate.app.storage.look_store import LookStore, uploaded
from palpate.app.storage.result_store import DAMAGED
from palpate.app.storage.stored_results import StoredResults
from palpate.foundation.errors import DatasetError
from palpate.importing.rules import SequenceWindow

__all__ = ["router"]

router = APIRouter(prefix="/looks", tags=["looks"])
_LONGEST_TEXT = 2**19


class LookBody(BaseModel):
    """Recordings to look at, with what is stated about them; or a dataset by its name.

    A file is the token of an upload, or a path on the server's disk from an allowed place. `setup`
    is the text of a dataset.toml, `setup_dataset` the name of a dataset whose setup is taken.
    `mapping` is the text of an import.toml, whose files are looked for among these by their names.
    `streams` names streams by role; an empty name is for none.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"files": ["/data/bench.bag"]}, {"dataset": "block-01"}]},
    )

    files: list[str] = Field(default_factory=list, max_length=1000)
    dataset: str | None = Field(default=None, max_length=255)
    setup: str | None = Field(default=None, max_length=_LONGEST_TEXT)
    setup_dataset: str | None = Field(default=None, max_length=255)
    mapping: str | None = Field(default=None, max_length=_LONGEST_TEXT)
    streams: dict[Literal["pose", "cloud", "camera", "wrench"], str] | None = None
    name: str | None = Field(default=None, max_length=64)


class LookImport(BaseModel):
    """Name of the new dataset, and an edited mapping and edited sequences where there are some."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", json_schema_extra={"examples": [{"name": "gel-block"}]}
    )

    name: str = Field(min_length=1, max_length=64)
    mapping: str | None = Field(default=None, max_length=_LONGEST_TEXT)
    sequences: list[SequenceWindow] | None = Field(default=None, max_length=2000)


@router.post("", status_code=202)
def start(body: LookBody, services: CurrentServices, key: IdempotencyKey = None) -> JobOut:
    """Queue a look; its result is `{"look": id}`, and the id of the job is the look's."""
    settings = services.settings
    request: dict[str, Any] = {
        "runs": str(settings.runs),
        "most": settings.largest_dataset,
        "sent": body.model_dump(mode="json"),
        **body.model_dump(include={"setup", "mapping", "streams"}),
    }
    if body.dataset is not None:
        beside = (body.setup, body.setup_dataset, body.mapping)
        if body.files or any(one is not None for one in beside):
            raise DatasetError(
                "a dataset has its setup and sequences; expected it alone, or files", key="dataset"
            )
        folder = services.library.path(body.dataset)
        request |= {"dataset": str(folder), "files": [], "name": body.name or body.dataset}
    else:
        if not body.files:
            raise DatasetError("no file is named; expected recordings, or a dataset", key="files")
        named = [_place(file, services) for file in body.files]
        if body.setup_dataset is not None:
            request["setup_from"] = str(_setup_folder(body, services))
        request |= {
            "files": [str(path) for path, _ in named],
            "uploads": [str(path) for path, is_upload in named if is_upload],
            "name": body.name or named[0][0].stem,
        }
    return job_out(services.jobs.submit("look", request, "look", key))


def _setup_folder(body: LookBody, services: Services) -> Path:
    """Folder of the dataset whose setup is taken."""
    if body.setup is not None:
        raise DatasetError(
            "the setup is stated twice; expected setup or setup_dataset", key="setup"
        )
    return services.library.path(str(body.setup_dataset))


def _place(file: str, services: Services) -> tuple[Path, bool]:
    """Place of a file on this machine, and whether it is an upload."""
    found = uploaded(services.settings.runs, file)
    if found is not None:
        return found, True
    path = readable_path(file, services, "files")
    if not path.exists():
        raise DatasetError(f"{file} does not exist; expected a recording", key="files", value=file)
    return path, False


@router.get("")
def listed(
    services: CurrentServices, response: Response, page: RequestedPage
) -> list[dict[str, Any]]:
    """Looks, the newest first: `source` says what each is of; null before it is finished.

    The header X-Total-Count has their number.
    """
    store = LookStore(services.settings.runs)
    rows = paginate(names_and_jobs(store, services.jobs), page, response)
    return [{"id": name, "job": job, "source": _source(store, name)[0]} for name, job in rows]


def _source(store: LookStore, name: str) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Source of a look, and the request that was sent for it; None where that is not known."""
    try:
        source = store.request(name)
    except (*DAMAGED, Missing):
        return None, None
    return source, source.pop("request", None)


@router.get("/{identity}")
def one(identity: str, services: CurrentServices) -> dict[str, Any]:
    """Streams, tool, forces, times of clouds, touches and sequences of one look, and the `request`
    for it as it was sent; 409 while its job is at work.
    """
    store = LookStore(services.settings.runs)
    found = store.result(identity)
    if found is None:
        _refuse_unfinished(identity, services)
        raise store.missing(identity)
    return {**found, "id": identity, "request": _source(store, identity)[1]}


@router.delete("/{identity}", status_code=204)
def delete(identity: str, services: CurrentServices) -> None:
    """Delete a look with the recordings that were uploaded for it. 409 while its job is at work."""
    _refuse_unfinished(identity, services)
    StoredResults(services.settings.runs).delete("look", identity)


def _refuse_unfinished(identity: str, services: Services) -> None:
    job = job_of(LookStore(services.settings.runs), identity, services.jobs)
    if job is not None and job["state"] in ("queued", "running"):
        raise Conflict(f"look {identity} is at work: wait for its job, or stop it", look=identity)


@router.post("/{identity}/import", status_code=202)
def bring(
    identity: str, body: LookImport, services: CurrentServices, key: IdempotencyKey = None
) -> JobOut:
    """Queue the import of the recordings of a look as a dataset, with edited sequences where they
    are sent: each with name, recording, start and end [s], kind and split.
    """
    found = one(identity, services)
    if found.get("source", {}).get("kind") == "dataset":
        raise Conflict(f"look {identity} is of a dataset: it is there already", look=identity)
    refuse_taken(body.name, services, key)
    request = {
        "look": identity,
        "name": body.name,
        "runs": str(services.settings.runs),
        "datasets": str(services.settings.datasets),
        "mapping": body.mapping,
        "sequences": None
        if body.sequences is None
        else [window.model_dump() for window in body.sequences],
    }
    return job_out(services.jobs.submit("import", request, f"import-{body.name}", key))
