"""Datasets by folder name: their list, and checks of one."""

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
    """The datasets folder and the names of the datasets in it."""
    return {"folder": str(services.settings.datasets), "datasets": services.library.names()}


@router.get("/{name}")
def one(name: str, services: CurrentServices) -> dict[str, Any]:
    """Phantom, tool, splits and sequences of one dataset, after the checks of opening it."""
    return dataset_summary(services.library.open(name))


@router.get("/{name}/check")
def check(name: str, services: CurrentServices) -> dict[str, Any]:
    """The same after reading every file, with warnings and missing data; 422 names the place of an
    error and the expected value.
    """
    dataset = services.library.open(name)
    summary = check_dataset(dataset)
    return {
        **dataset_summary(dataset),
        "warnings": list(summary.warnings),
        "lacks": [lack.sentence for lack in summary.lacks],
    }
