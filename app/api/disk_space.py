"""What results and caches take on the disk, and how to make room."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter

from palpate.app.services import CurrentServices

__all__ = ["router"]

router = APIRouter(prefix="/disk", tags=["disk"])


@router.get("")
def usage(services: CurrentServices) -> dict[str, Any]:
    """Bytes below the runs folder: all, what of it are caches, and the limit beyond which the
    oldest caches are dropped.
    """
    return asdict(services.disk.usage())


@router.post("/empty")
def empty(services: CurrentServices) -> dict[str, Any]:
    """Drop all caches: what is lost can be worked out once more. Results, and archives that wait
    for their import, stay.
    """
    return asdict(services.disk.trim(0, services.awaited()))
