"""Disk usage of results and caches, and deletion of both."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter

from palpate.app.http_errors import Conflict, Missing
from palpate.app.services import CurrentServices, Services
from palpate.app.storage.disk_usage import Usage
from palpate.app.storage.stored_results import StoredResults

__all__ = ["router"]

router = APIRouter(prefix="/disk", tags=["disk"])
_NAMED = 8
"""Largest results that are named."""


@router.get("")
def usage(services: CurrentServices) -> dict[str, Any]:
    """Bytes below the runs folder: all of them, those of caches, and the limit beyond which the
    oldest caches are deleted, and new jobs are refused where the results alone take more.

    `largest` names the results that take most room.
    """
    return _answer(services, services.disk.usage())


@router.post("/empty")
def empty(services: CurrentServices) -> dict[str, Any]:
    """Delete all caches. Their content can be computed again. Results, and archives that wait for
    their import, stay.
    """
    return _answer(services, services.disk.trim(0, services.awaited()))


@router.delete("/{kind}/{name}")
def delete(kind: str, name: str, services: CurrentServices) -> dict[str, Any]:
    """Delete a run, sweep, training, evaluation or look for good; the answer is the usage without
    it. 409 while its job is at work.
    """
    results = StoredResults(services.settings.runs)
    store = results.store(kind)
    try:
        job = services.jobs.get(name)
    except Missing:
        job = None
    if job is not None and not job.state.is_finished:
        raise Conflict(f"{store.kind} {name} is at work: stop it first", **{store.kind: name})
    results.delete(kind, name)
    return _answer(services, services.disk.usage())


def _answer(services: Services, now: Usage) -> dict[str, Any]:
    largest = StoredResults(services.settings.runs).largest(_NAMED)
    return {**asdict(now), "largest": [asdict(one) for one in largest]}
