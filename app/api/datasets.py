"""Datasets by folder name: what there is, and whether it is in order."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from palpate.app.reporting.json_values import dataset_summary
from palpate.app.services import CurrentServices
from palpate.dataset.check import check_dataset

__all__ = ["router"]

router = APIRouter(prefix="/datasets", tags=["datasets"])


@router.get("")
def listed(services: CurrentServices) -> dict[str, Any]:
    """The folder that is looked into and the names found there."""
    return {"folder": str(services.settings.datasets), "datasets": services.library.names()}


@router.get("/{name}")
def one(name: str, services: CurrentServices) -> dict[str, Any]:
    """Phantom, tool, splits and sequences of one dataset, after the checks that opening makes."""
    return dataset_summary(services.library.open(name))


@router.get("/{name}/check")
def check(name: str, services: CurrentServices) -> dict[str, Any]:
    """The same after reading every file, with what is doubtful; 422 with place and expectation if
    anything is off.
    """
    dataset = services.library.open(name)
    found = check_dataset(dataset)
    return {
        **dataset_summary(dataset),
        "warnings": list(found.warnings),
        "lacks": [lack.sentence for lack in found.lacks],
    }
