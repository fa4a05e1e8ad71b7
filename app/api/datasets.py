"""Datasets by folder name: list, and check."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from palpate.app.reporting.json_values import dataset_summary
from palpate.app.services import ONE_WHOLE_READ, CurrentServices
from palpate.consistency import check_consistency
from palpate.dataset.check import check_dataset

__all__ = ["router"]

router = APIRouter(tags=["datasets"])


@router.get("/datasets")
def listed(services: CurrentServices) -> dict[str, Any]:
    """The datasets folder and the names of the datasets in it."""
    return {"folder": str(services.settings.datasets), "datasets": services.library.names()}


@router.get("/datasets/{name}")
def one(name: str, services: CurrentServices) -> dict[str, Any]:
    """Phantom, tool, splits and sequences of one dataset, after the checks of opening it."""
    return dataset_summary(services.library.open(name))


@router.get("/datasets/{name}/check", dependencies=[ONE_WHOLE_READ])
def check(name: str, services: CurrentServices) -> dict[str, Any]:
    """The same after reading every file, with warnings and missing data; 422 names the place of an
    error and the expected value.
    """
    dataset = services.library.open(name)
    summary = check_dataset(dataset)
    return {
        **dataset_summary(dataset),
        "warnings": [*summary.warnings, *check_consistency(dataset, None)],
        "lacks": [lack.sentence for lack in summary.lacks],
    }
