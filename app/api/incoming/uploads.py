"""Uploads of recordings, one file each, for looks at them."""

from __future__ import annotations

import asyncio
import os
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request

from palpate.app.api.incoming.received_body import arriving, received
from palpate.app.services import CurrentServices
from palpate.app.storage.look_store import LONGEST, new_upload
from palpate.foundation.errors import DatasetError

__all__ = ["router"]

router = APIRouter(tags=["looks"])
_BODY = {
    "requestBody": {
        "required": True,
        "description": "The file as it is: a bag, a table, a dataset.toml, or a folder packed as "
        ".zip or .tar.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post("/uploads", status_code=201, openapi_extra=_BODY)
async def store(
    request: Request,
    services: CurrentServices,
    file: Annotated[str, Query(min_length=1, max_length=LONGEST)],
) -> dict[str, Any]:
    """Store the body as a file of this name; the token of the answer stands for it in the `files`
    of a look. An upload is kept until room is needed.
    """
    await asyncio.to_thread(services.jobs.admit)
    token, place = new_upload(services.settings.runs, file)
    coming = place.with_name(".part")
    with arriving(services, coming), arriving(services, place):
        try:
            await received(request, coming)
            if not coming.stat().st_size:
                raise DatasetError(f"{file} is empty; expected a recording", key="body")
            os.replace(coming, place)
        except BaseException:
            coming.unlink(missing_ok=True)
            place.parent.rmdir()
            raise
    return {"file": token, "name": file, "bytes": place.stat().st_size}
