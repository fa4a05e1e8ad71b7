"""Datasets whose sequences are bags: imported once into a cache, and opened from there."""

from __future__ import annotations

import hashlib
import os
import warnings
from pathlib import Path

from palpate.dataset.files import read_toml
from palpate.dataset.folder import Dataset
from palpate.dataset.folder import open_dataset as open_tables
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import import_recordings
from palpate.importing.sources.bag_readers import BAG_SUFFIXES, storage_files
from palpate.importing.survey import survey

__all__ = ["CACHE", "folder_of_tables", "has_bags", "open_dataset"]

CACHE = "PALPATE_BAGS"
"""Environment variable that names the folder of imported bags; by default in the user's cache."""
_LIMIT = 2**20
_FORMAT = 1
"""Changes whenever the same bags are imported in another way."""


def has_bags(folder: Path) -> bool:
    """Whether a folder is a dataset that states [topics] and has a bag among its sequences."""
    try:
        inside = sorted((folder / "sequences").iterdir())
        stated = read_toml(folder, "dataset.toml", _LIMIT)
    except (OSError, DatasetError):
        return False
    return "topics" in stated and any(
        one.suffix in BAG_SUFFIXES or (one.is_dir() and bool(storage_files(one)))
        for one in inside
        if not one.name.startswith((".", "@"))
    )


def open_dataset(path: Path | str) -> Dataset:
    """Open a dataset folder and check everything but the points of its clouds.

    Bags among its sequences are imported into a cache first; each warning of that import is a
    UserWarning. The points are checked when they are read, or by `Dataset.validate`. Raises
    DatasetError.
    """
    notes = ImportNotes()
    folder = folder_of_tables(Path(path), notes)
    for warning in notes.warnings:
        warnings.warn(warning, stacklevel=2)
    return open_tables(folder)


def folder_of_tables(folder: Path, notes: ImportNotes, report: Report = silent) -> Path:
    """Return the folder itself, or that of the same dataset with its bags as tables and clouds.

    Bags are imported into a cache by what dataset.toml states in [topics]. An import is found
    again by the names, sizes and times of change of all files of the dataset.

    Args:
        folder: of a dataset.
        notes: take decisions and warnings of an import.
        report: of the progress.

    Raises DatasetError where a bag cannot be imported.
    """
    if not has_bags(folder):
        return folder
    kept = _cache() / f"{folder.resolve().name}-{_state(folder)}"
    if (kept / "dataset.toml").is_file():
        return kept
    found = survey([folder], None)
    try:
        mapping = found.proposal(folder.resolve().name, notes)
    finally:
        found.close()
    whole = mapping.model_copy(
        update={"cutting": mapping.cutting.model_copy(update={"cut": False, "trim": False})}
    )
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(
            f"{kept.parent} cannot be made ({error.strerror}), and bags are imported there: name "
            f"another folder by the environment variable {CACHE}",
            file=str(kept.parent),
        ) from None
    import_recordings(whole, Path.cwd(), kept, notes, report)
    return kept


def _cache() -> Path:
    if stated := os.environ.get(CACHE):
        return Path(stated)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "palpate" / "bags"


def _state(folder: Path) -> str:
    """Digest of the files' names, sizes and times of change."""
    said = [repr(_FORMAT)]
    for file in sorted(one for one in folder.rglob("*") if one.is_file()):
        known = file.stat()
        said.append(f"{file.relative_to(folder)} {known.st_size} {known.st_mtime_ns}")
    return hashlib.sha256("\n".join(said).encode()).hexdigest()[:16]
