"""Looks on disk, below the runs folder, and the uploaded recordings that they are taken of."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from uuid import uuid4

from palpate.app.http_errors import Missing
from palpate.app.storage.archive import unpack
from palpate.app.storage.dataset_import import UPLOADS
from palpate.app.storage.result_store import ResultStore
from palpate.first_look.look_files import LOOK, LookFiles
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report

__all__ = ["FILES", "LookStore", "new_upload", "placed", "uploaded"]

LOOKS, FILES, SOURCE = "looks", "files", "source.json"
"""Folder below the runs; within a look the folder of its recordings, and the file that says what it
is of."""
RECORDINGS = f"{UPLOADS}/recordings"
_TOKEN = re.compile(r"upload-[0-9a-f]{32}", re.ASCII)
_PACKED = (".zip", ".tar", ".tgz", ".gz", ".tbz2", ".bz2", ".xz", ".txz")
LONGEST = 200
"""Bytes of an uploaded file's name."""


class LookStore(ResultStore):
    """The folder of looks."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs / LOOKS, "look", SOURCE, LOOK)

    def files(self, name: str) -> LookFiles:
        """The files of a finished look; raises Missing for another name."""
        if not self.has_begun(name) or not (self.folder / name / self.last).is_file():
            raise self.missing(name)
        return LookFiles(self.folder / name)


def new_upload(runs: Path, name: str) -> tuple[str, Path]:
    """Token and place of a file that is about to arrive; DatasetError for a name that no file may
    have.
    """
    plain = name.isprintable() and not set(name) & set('/\\:*?"<>|') and len(name) > 0
    if not plain or name.startswith(".") or len(name.encode()) > LONGEST:
        raise DatasetError(
            f"{name[:80]!r} is no name of a file; expected at most {LONGEST} printable bytes, "
            "no folders: rename the file",
            key="file",
        )
    token = f"upload-{uuid4().hex}"
    return token, runs / RECORDINGS / token / name


def uploaded(runs: Path, token: str) -> Path | None:
    """The file of a token; None where the text is no token. Raises Missing where it is gone."""
    if not _TOKEN.fullmatch(token):
        return None
    folder = runs / RECORDINGS / token
    found = (
        [one for one in folder.iterdir() if not one.name.startswith(".")] if folder.is_dir() else []
    )
    if not found:
        raise Missing(f"the upload {token} is no longer there: upload the file again", file=token)
    return found[0]


def placed(source: Path, folder: Path, most: int, report: Report) -> Path:
    """Put an uploaded file into a look's folder: an archive unpacked, another linked; returns its
    place there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if source.suffix.lower() in _PACKED:
        place = _free(folder, source.name.split(".")[0] or "archive")
        place.mkdir()
        unpack(source, place, most, report)
        inside = list(place.iterdir())
        return inside[0] if len(inside) == 1 and inside[0].is_dir() else place
    place = _free(folder, source.name)
    place.parent.mkdir(exist_ok=True)
    try:
        os.link(source, place)
    except OSError:
        shutil.copyfile(source, place)
    return place


def _free(folder: Path, name: str) -> Path:
    """A place of this name; within a folder of its own where the name is taken."""
    place, number = folder / name, 1
    while place.exists():
        number += 1
        place = folder / str(number) / name
    return place
