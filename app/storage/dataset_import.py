"""Folders and names of dataset imports."""

from __future__ import annotations

from pathlib import Path

from palpate.app.storage.result_store import NAME
from palpate.foundation.errors import DatasetError

__all__ = ["STAGING", "UPLOADS", "check_name"]

STAGING = ".importing"
"""Folder below the datasets in which an import is unpacked and checked."""
UPLOADS = "uploads"
"""Folder below the runs in which uploaded archives wait for their import."""


def check_name(name: str, datasets: Path) -> None:
    """Raise DatasetError for an invalid dataset name, and for one that is taken."""
    if not NAME.fullmatch(name) or len(name) > 64:
        raise DatasetError(
            f"{name!r} is no name: at most 64 letters, digits, dot, dash, underscore", key="name"
        )
    if (datasets / name).exists():
        raise DatasetError(
            f"there is a dataset {name} already: choose another name", key="name", value=name
        )
