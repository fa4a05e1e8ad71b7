"""Datasets that are brought: checked as a whole beside the others, and renamed into place, or
refused with every problem.
"""

from __future__ import annotations

from pathlib import Path

from palpate.app.storage.run_store import NAME
from palpate.foundation.errors import DatasetError

__all__ = ["STAGING", "UPLOADS", "check_name"]

STAGING = ".importing"
"""Folder below the datasets in which what is brought is looked at."""
UPLOADS = "uploads"
"""Folder below the runs where archives wait for their import."""


def check_name(name: str, datasets: Path) -> None:
    """Refuse what is no name of a dataset folder, and one that is taken."""
    if not NAME.fullmatch(name) or len(name) > 64:
        raise DatasetError(
            f"{name!r} is no name: at most 64 letters, digits, dot, dash, underscore", key="name"
        )
    if (datasets / name).exists():
        raise DatasetError(
            f"there is a dataset {name} already: choose another name", key="name", value=name
        )
