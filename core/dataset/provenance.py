"""Provenance of results: a digest of the dataset's files, and the software."""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from palpate.foundation.errors import DatasetError, RunError
from palpate.foundation.source_digest import source_digest

__all__ = [
    "check_data",
    "check_unchanged",
    "data_changed",
    "dataset_digest",
    "made_from",
    "software_of",
]

_WHOLE, _BLOCK, _BLOCKS = 2**18, 2**16, 4
"""Bytes up to which a file is read whole; bytes of a block, and number of blocks, of a larger."""


def dataset_digest(folder: Path, *, full: bool = False) -> str:
    """Return a digest of names, sizes and contents of all files of a dataset.

    Of a file above 256 KiB four blocks of 64 KiB are read, evenly apart and with both ends, so that
    another content of the same size may be missed. Hidden files do not count, and neither does the
    time of a change, which copying changes.

    Args:
        folder: of the dataset.
        full: read every file whole; the digest is then another one, which begins with "full-".

    Raises DatasetError for a file that cannot be read.
    """
    digest = hashlib.sha256()
    for name, path in _files(folder):
        try:
            size = path.stat().st_size
            digest.update(f"{name}\n{size}\n".encode())
            with path.open("rb") as stream:
                if full or size <= _WHOLE:
                    while block := stream.read(2**20):
                        digest.update(block)
                    continue
                for number in range(_BLOCKS):
                    stream.seek(number * (size - _BLOCK) // (_BLOCKS - 1))
                    digest.update(stream.read(_BLOCK))
        except OSError as error:
            raise DatasetError(
                f"{name} cannot be read ({error.strerror}): give it back its rights, or remove it",
                file=name,
            ) from error
    return ("full-" if full else "") + digest.hexdigest()[:16]


def made_from(folder: Path) -> dict[str, Any]:
    """Return what a result on this dataset is made from, as plain values for JSON.

    `data` is its `dataset_digest`, `version` that of Palpate, `code` the digest of the sources, and
    `commit` that of the checkout, with "-dirty" for changed files; None outside of one.
    """
    return {"data": dataset_digest(folder), **software_of()}


def check_data(stored: Mapping[str, Any], now: Mapping[str, Any], kind: str, name: str) -> None:
    """Refuse to resume work that began on other data; RunError names both digests.

    Args:
        stored: `made_from` of the work when it began; empty where it does not state it.
        now: `made_from` of the dataset as it is.
        kind: of the work, as in "sweep".
        name: of the work.
    """
    before = stored.get("data")
    if before is not None and before != now["data"]:
        raise RunError(
            f"{kind} {name} began on other data (digest {before}) than the dataset has now (digest "
            f"{now['data']}): start a new {kind}, or put the old data back",
            file="request.json",
            value=now["data"],
        )


def check_unchanged(folder: Path, made: Mapping[str, Any]) -> None:
    """Raise DatasetError where the files of a dataset changed while a result was made from them.

    Args:
        folder: of the dataset.
        made: `made_from` of the dataset before the work.
    """
    now = dataset_digest(folder)
    if now != made["data"]:
        raise DatasetError(
            f"the files of {folder.name} changed during the work (digest {made['data']} before, "
            f"{now} after it): start again once nothing writes there",
            value=now,
        )


def data_changed(folder: Path, made: Mapping[str, Any]) -> bool | None:
    """Return whether a dataset's files differ from those that a result was made from.

    None where the result does not state its data, or the dataset is no longer there. The files are
    read again only when a name, a size or a time of change differs.

    Args:
        folder: of the dataset.
        made: `made_from` as stored with the result; may be empty.
    """
    before = made.get("data")
    if before is None or not folder.is_dir():
        return None
    try:
        return bool(_digest_by_stamp(folder, _stamp(folder)) != before)
    except (DatasetError, OSError):
        return None


def _files(folder: Path) -> list[tuple[str, Path]]:
    """Return names below the folder and paths of all regular files that are not hidden, sorted."""
    found = []
    for root, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in files:
            path = os.path.join(root, name)
            if not name.startswith(".") and os.path.isfile(path):
                found.append((os.path.relpath(path, folder), Path(path)))
    return sorted(found)


def _stamp(folder: Path) -> str:
    """Return a digest of names, sizes and times of change."""
    digest = hashlib.sha256()
    for name, path in _files(folder):
        state = path.stat()
        digest.update(f"{name}\n{state.st_size}\n{state.st_mtime_ns}\n".encode())
    return digest.hexdigest()


_KNOWN: dict[Path, tuple[str, str]] = {}


def _digest_by_stamp(folder: Path, stamp: str) -> str:
    """Return the digest of a dataset, which is computed again for another stamp alone."""
    known = _KNOWN.get(folder)
    if known is None or known[0] != stamp:
        known = _KNOWN[folder] = (stamp, dataset_digest(folder))
    return known[1]


@cache
def software_of() -> dict[str, str | None]:
    """Version, commit and digest of the sources of this Palpate, as in `made_from`."""
    try:
        number = version("palpate")
    except PackageNotFoundError:
        number = "unknown"
    return {"version": number, "commit": _commit(), "code": source_digest(excluded=())}


def _commit() -> str | None:
    """Return the commit of the checkout that the sources lie in; None outside of one."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    asked = ["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    command = ["git", "-C", str(root), *asked]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return run.stdout.strip() or None
