"""Datasets that are brought: checked as a whole beside the others, and renamed into place, or refused with every problem."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from app.runs import NAME
from app.unpacking import copy_folder, dataset_root, unpack
from core.errors import DatasetError
from core.progress import Report, part

__all__ = ["STAGING", "UPLOADS", "bring", "check_name"]

STAGING = ".importing"
"""Folder below the datasets in which what is brought is looked at."""
UPLOADS = "uploads"
"""Folder below the runs where archives wait for their import."""


def check_name(name: str, datasets: Path) -> None:
    """Refuse what is no name of a dataset folder, and one that is taken."""
    if not NAME.fullmatch(name) or len(name) > 64:
        raise DatasetError(f"{name!r} is no name: at most 64 letters, digits, dot, dash, underscore", key="name")
    if (datasets / name).exists():
        raise DatasetError(f"there is a dataset {name} already: choose another name", key="name", value=name)


def bring(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """The job: unpack `request["archive"]`, or copy `request["folder"]`, check every file, and make it the dataset `name`.

    An archive is kept until it was taken or refused, so that an interrupted import can be done once more.
    """
    from core.dataset import open_dataset  # noqa: PLC0415 (heavy)
    from core.dataset.problems import refuse_problems  # noqa: PLC0415 (heavy)

    datasets, name = Path(request["datasets"]), str(request["name"])
    check_name(name, datasets)
    aside = datasets / STAGING / Path(request["scratch"]).name
    aside.mkdir(parents=True, exist_ok=True)
    archive = Path(request["archive"]) if request.get("archive") else None
    try:
        if archive is not None:
            if not archive.is_file():
                raise DatasetError("the archive is no longer there: upload it again", file=archive.name)
            unpack(archive, aside, int(request["most"]), part(report, 0.0, 0.4))
        else:
            copy_folder(Path(request["folder"]), aside, int(request["most"]), part(report, 0.0, 0.4))
        root = dataset_root(aside)
        refuse_problems(root, part(report, 0.4, 1.0))
    except DatasetError:
        if archive is not None:
            archive.unlink(missing_ok=True)
        raise
    opened = open_dataset(root)
    check_name(name, datasets)
    os.rename(root, datasets / name)
    if archive is not None:
        archive.unlink(missing_ok=True)
    return {"dataset": name, "sequences": len(opened.sequences), "clouds": sum(map(len, opened.loaded))}
