"""Import of a dataset: an archive is unpacked or a folder copied, checked, and put in its place."""

from __future__ import annotations

import contextlib
import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.app.storage.archive import copy_folder, dataset_root, unpack
from palpate.app.storage.dataset_import import STAGING, check_name
from palpate.app.storage.held_folder import held_folder
from palpate.foundation.errors import DatasetError
from palpate.foundation.processes import TimeUsedError, limited_memory, limited_time
from palpate.foundation.progress import Report, part

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["import_dataset"]

_MEMORY, _TIME = 2**29, 3600
"""Address space [bytes] and processor time [s] that the import of a dataset may take."""


def import_dataset(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Unpack `request["archive"]`, or copy `request["folder"]`, check every file, and make it the
    dataset `name`.

    The archive stays until it is accepted or refused, so that an interrupted import can be
    repeated.
    """
    datasets, name = Path(request["datasets"]), str(request["name"])
    check_name(name, datasets)
    with contextlib.ExitStack() as held:
        try:
            aside = held.enter_context(
                held_folder(datasets / STAGING / Path(request["scratch"]).name)
            )
        except OSError as error:
            raise DatasetError(
                f"no dataset can be imported into {datasets} ({error.strerror}): let the server "
                "write there, or start it with another folder of datasets",
                key="datasets",
            ) from error
        with limited_time(_TIME):
            opened = _imported(request, aside, datasets / name, report)
    return {
        "dataset": name,
        "sequences": len(opened.sequences),
        "clouds": sum(map(len, opened.loaded)),
    }


def _imported(request: dict[str, Any], aside: Path, whole: Path, report: Report) -> Dataset:
    """Fill `aside`, check it, and rename it to `whole`; returns the dataset."""
    from palpate.dataset import open_dataset
    from palpate.dataset.dataset_problems import refuse_problems
    from palpate.dataset.schema import read_config

    archive = Path(request["archive"]) if request.get("archive") else None
    try:
        with limited_memory(_MEMORY):
            root = _filled(request, archive, aside, part(report, 0.0, 0.4))
            surface = read_config(root).surface
        if surface:  # its check needs a library that maps more address space than the limit
            importlib.import_module("open3d")
        with limited_memory(_MEMORY):
            refuse_problems(root, part(report, 0.4, 1.0))
    except (DatasetError, MemoryError, TimeUsedError) as error:
        if archive is not None:
            archive.unlink(missing_ok=True)
        if isinstance(error, DatasetError):
            raise
        what = (
            f"more than {_MEMORY // 2**20} MiB of memory"
            if isinstance(error, MemoryError)
            else f"more than {_TIME // 60} minutes of processor time"
        )
        raise DatasetError(f"its files take {what} to read: check what was exported") from None
    opened = open_dataset(root)
    check_name(whole.name, whole.parent)
    try:
        os.rename(root, whole)
    except OSError:
        check_name(whole.name, whole.parent)  # another server was faster
        raise
    if archive is not None:
        archive.unlink(missing_ok=True)
    return opened


def _filled(request: dict[str, Any], archive: Path | None, aside: Path, report: Report) -> Path:
    """Fill `aside` from an archive or a folder; returns the dataset's folder in it."""
    most = int(request["most"])
    if archive is None:
        copy_folder(Path(request["folder"]), aside, most, report)
    elif archive.is_file():
        unpack(archive, aside, most, report)
    else:
        raise DatasetError("the archive is no longer there: upload it again", file=archive.name)
    return dataset_root(aside)
