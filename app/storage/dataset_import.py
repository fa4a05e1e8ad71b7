"""Folders, names and notes of dataset imports."""

from __future__ import annotations

import json
from pathlib import Path

from palpate.app.storage.result_store import NAME
from palpate.foundation.errors import DatasetError

__all__ = ["STAGING", "UPLOADS", "check_name", "note_placing", "was_placed"]

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


def note_placing(note: Path, folder: Path) -> None:
    """Write down which folder an import is about to rename to its dataset.

    A server may end between the renaming and the record of it; the repeated import then finds its
    own dataset in place.

    Args:
        note: file of this import.
        folder: that is checked and complete.
    """
    note.write_text(json.dumps(_identity(folder)))


def was_placed(note: Path, dataset: Path) -> bool:
    """Return whether this dataset is the folder that the import noted by `note_placing`."""
    try:
        return bool(json.loads(note.read_text()) == _identity(dataset))
    except (OSError, ValueError):
        return False


def _identity(folder: Path) -> list[int]:
    """Device, inode and time of change [ns] of a folder, which a renaming keeps."""
    found = folder.stat()
    return [found.st_dev, found.st_ino, found.st_mtime_ns]
