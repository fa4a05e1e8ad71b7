"""The causes that can be named, with parameters, units and bounds."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

__all__ = ["router"]

router = APIRouter(prefix="/effects", tags=["effects"])


@router.get("")
def listed() -> list[dict[str, Any]]:
    """The catalogue."""
    return []
