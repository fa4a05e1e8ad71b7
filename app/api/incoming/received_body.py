"""Bodies of requests that are stored as files while they arrive."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fastapi import Request

from palpate.app.services import Services

__all__ = ["arriving", "received"]


@contextmanager
def arriving(services: Services, file: Path) -> Iterator[None]:
    """Spare a file in the block from being deleted for room."""
    services.arriving.append(str(file))
    try:
        yield
    finally:
        services.arriving.remove(str(file))


async def received(request: Request, coming: Path) -> str:
    """Store the body as this file, and return its digest; a part of a body is deleted."""
    coming.parent.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256()
    try:
        with coming.open("wb") as sink:
            async for chunk in request.stream():
                digest.update(chunk)
                await asyncio.to_thread(sink.write, chunk)
    except BaseException:
        coming.unlink(missing_ok=True)
        raise
    return digest.hexdigest()
