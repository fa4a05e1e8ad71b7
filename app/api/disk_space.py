"""Disk usage of results and caches, and deletion of caches."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter

from palpate.app.services import CurrentServices

__all__ = ["router"]

router = APIRouter(prefix="/disk", tags=["disk"])


@router.get("")
def usage(services: CurrentServices) -> dict[str, Any]:
    """Bytes below the runs folder: all of them, those of caches, and the limit beyond which the
    oldest caches are deleted.
    """
    return asdict(services.disk.usage())


@router.post("/empty")
def empty(services: CurrentServices) -> dict[str, Any]:
    """Delete all caches. Their content can be computed again. Results, and archives that wait for
    their import, stay.
    """
    return asdict(services.disk.trim(0, services.awaited()))
