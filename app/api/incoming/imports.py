"""Imports of datasets: an archive as the body of a request, or a folder on the server's disk."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from typing import Annotated
from uuid import uuid4

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, ConfigDict, Field

from palpate.app.api.incoming.received_body import arriving, received
from palpate.app.http_errors import Conflict
from palpate.app.jobs.job_records import Job, JobState
from palpate.app.jobs.job_results import job_out
from palpate.app.schemas import JobOut
from palpate.app.services import CurrentServices, IdempotencyKey, Services
from palpate.app.storage.archive_reader import is_archive
from palpate.app.storage.dataset_import import UPLOADS, check_name
from palpate.foundation.errors import DatasetError, PalpateError

__all__ = ["readable_path", "refuse_taken", "router"]

router = APIRouter(tags=["datasets"])
_BODY = {
    "requestBody": {
        "required": True,
        "description": "The dataset's folder as .zip or .tar, compressed or not.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


class FolderRequest(BaseModel):
    """A folder on the server's disk, and the name of the new dataset."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        json_schema_extra={"examples": [{"folder": "/data/bench/block-07", "name": "block-07"}]},
    )

    folder: str = Field(min_length=1, max_length=1000)
    name: str = Field(min_length=1, max_length=64)


@router.post("/imports", status_code=202, openapi_extra=_BODY)
async def upload(
    request: Request,
    services: CurrentServices,
    name: Annotated[str, Query(min_length=1, max_length=64)],
    key: IdempotencyKey = None,
) -> JobOut:
    """Take the body as an archive and queue its import. The archive is checked completely; the
    dataset appears whole or not at all.
    """
    await asyncio.to_thread(refuse_taken, name, services, key)
    folder = services.settings.runs / UPLOADS
    coming = folder / f".{uuid4().hex}.part"
    with arriving(services, coming):
        digest = await received(request, coming)
        await asyncio.to_thread(_refuse_no_archive, coming)
        # The same request sent twice is one file. An archive that is sent under two names is two,
        # since each import deletes its own.
        archive = folder / f"{digest[:32]}-{name}.archive"
        with arriving(services, archive):
            os.replace(coming, archive)
            job = await asyncio.to_thread(_queue_archive, services, name, archive, key)
    return job_out(job)


@router.post("/imports/folder", status_code=202)
def folder(request: FolderRequest, services: CurrentServices, key: IdempotencyKey = None) -> JobOut:
    """Queue the import of a folder on the server's disk, from an allowed place. The folder is
    copied and not changed.
    """
    refuse_taken(request.name, services, key)
    path = readable_path(request.folder, services, "folder")
    if not path.is_dir():
        raise DatasetError(f"{request.folder} is no folder that the server can read", key="folder")
    return job_out(_queue(services, request.name, {"folder": str(path)}, key))


def refuse_taken(name: str, services: Services, key: str | None) -> None:
    """Raise Conflict where the name is taken, and NoSpace where there is no room for more results,
    unless the request is known by its key.
    """
    if services.jobs.knows(key):
        return
    services.jobs.admit()
    try:
        check_name(name, services.settings.datasets)
    except DatasetError as error:
        if "already" in error.message:
            raise Conflict(error.message, **error.where) from error
        raise


def _queue(services: Services, name: str, source: dict[str, str], key: str | None) -> Job:
    settings = services.settings
    job_request = {
        **source,
        "name": name,
        "datasets": str(settings.datasets),
        "most": settings.largest_dataset,
    }
    return services.jobs.submit("import", job_request, f"import-{name}", key)


def _queue_archive(services: Services, name: str, archive: Path, key: str | None) -> Job:
    """Queue the import of an archive. One that no import will take is deleted."""
    try:
        job = _queue(services, name, {"archive": str(archive)}, key)
    except PalpateError:
        if not services.is_awaited(archive):
            archive.unlink(missing_ok=True)
        raise
    if job.state is JobState.DONE:  # a repeated request
        archive.unlink(missing_ok=True)
    return job


def readable_path(named: str, services: Services, key: str) -> Path:
    """A path on the server's disk that requests may read; DatasetError for another."""
    try:
        path = Path(named).resolve()
        path.exists()
    except (OSError, ValueError) as error:  # too long for a name, or with a NUL
        raise DatasetError(f"{named} is no {key}: {error}", key=key) from error
    allowed = services.settings.import_roots
    if allowed is not None and not any(path.is_relative_to(root.resolve()) for root in allowed):
        raise DatasetError(
            f"{named} may not be imported from: start the server with "
            "--import-from FOLDER for one that may",
            key=key,
        )
    return path


def _refuse_no_archive(coming: Path) -> None:
    """Delete a body that is no archive, and raise DatasetError."""
    if is_archive(coming):
        return
    coming.unlink(missing_ok=True)
    raise DatasetError(
        "the body is neither a zip nor a tar; send the dataset's folder packed as one of them",
        key="body",
    )
