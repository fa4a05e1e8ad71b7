"""Import of a dataset: an archive is unpacked or a folder copied, checked, and put in its place."""

from __future__ import annotations

import contextlib
import importlib
import os
from pathlib import Path
from typing import Any

from palpate.app.jobs.look_jobs import import_look
from palpate.app.storage.archive import copy_folder, dataset_root, unpack
from palpate.app.storage.dataset_import import STAGING, check_name, note_placing, was_placed
from palpate.app.storage.held_folder import held_folder
from palpate.foundation.errors import DatasetError
from palpate.foundation.processes import TimeUsedError, limited_memory, limited_time
from palpate.foundation.progress import Report, part

__all__ = ["import_dataset"]

_MEMORY, _TIME = 2**29, 3600
"""Address space [bytes] and processor time [s] that the import of a dataset may take."""


def import_dataset(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Unpack `request["archive"]`, or copy `request["folder"]`, check every file, and make it the
    dataset `name`; or import the recordings of `request["look"]`.

    The archive stays until it is accepted or refused, so that an interrupted import can be
    repeated. Where it was interrupted after its dataset was in place, the repeated one says so.
    """
    if request.get("look"):
        return import_look(request, report)
    datasets, name = Path(request["datasets"]), str(request["name"])
    scratch = Path(request["scratch"]).name
    note = datasets / STAGING / f"{scratch}.placed"
    if was_placed(note, datasets / name):
        return _placed(request, datasets / name)
    check_name(name, datasets)
    with contextlib.ExitStack() as held:
        try:
            aside = held.enter_context(held_folder(datasets / STAGING / scratch))
        except OSError as error:
            raise DatasetError(
                f"no dataset can be imported into {datasets} ({error.strerror}): let the server "
                "write there, or start it with another folder of datasets",
                key="datasets",
            ) from error
        with limited_time(_TIME):
            _import(request, aside, datasets / name, note, report)
    return _placed(request, datasets / name)


def _placed(request: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the result of an import whose dataset is in place; its archive is deleted."""
    from palpate.dataset import open_dataset

    if request.get("archive"):
        Path(request["archive"]).unlink(missing_ok=True)
    opened = open_dataset(folder)
    return {
        "dataset": folder.name,
        "sequences": len(opened.sequences),
        "clouds": sum(map(len, opened.loaded)),
    }


def _import(request: dict[str, Any], aside: Path, whole: Path, note: Path, report: Report) -> None:
    """Fill `aside`, check it, and rename it to `whole`."""
    from palpate.dataset.dataset_problems import refuse_problems
    from palpate.dataset.schema import read_config

    archive = Path(request["archive"]) if request.get("archive") else None
    try:
        with limited_memory(_MEMORY):
            root = _filled(request, archive, aside, part(report, 0.0, 0.4))
            shape = read_config(root).shape
        if (
            shape is not None
        ):  # its check needs a library that maps more address space than the limit
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
    check_name(whole.name, whole.parent)
    note_placing(note, root)
    try:
        os.rename(root, whole)
    except OSError:
        check_name(whole.name, whole.parent)  # another server was faster
        raise


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
