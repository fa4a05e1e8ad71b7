"""Disk usage of the runs folder, kept below a limit by deleting the oldest caches, never a
result.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from palpate.app.storage.dataset_import import UPLOADS
from palpate.app.storage.run_store import EXPORTS
from palpate.app.storage.sweep_store import REPLAY_CACHE, SWEEPS
from palpate.app.storage.training_store import SAMPLE_CACHE, TRAININGS
from palpate.mesh.meshers.mesh_cache import FOLDER

__all__ = ["CACHES", "Disk", "Usage", "keep_meshes", "size_of"]

MESHES = ".meshes"
"""Folder below the runs of the meshes of shapes."""
CACHES = (f"{SWEEPS}/{REPLAY_CACHE}", f"{TRAININGS}/{SAMPLE_CACHE}", UPLOADS, EXPORTS, MESHES)
"""Folders below the runs whose content can be computed, or uploaded, again."""


@dataclass(frozen=True)
class Usage:
    """Bytes below the runs folder.

    Attributes:
        used: of all files.
        caches: of the files in caches.
        limit: that `used` should stay below.
        dropped: that were deleted by this call.
    """

    used: int
    caches: int
    limit: int
    dropped: int = 0


class Disk:
    """Disk usage of the runs folder; `limit` [bytes] is kept by deleting caches only."""

    def __init__(self, runs: Path, limit: int) -> None:
        self._runs, self._limit = runs, limit

    def usage(self) -> Usage:
        """Measure the current usage."""
        return Usage(size_of(self._runs), sum(size for _, size, _ in self._cached()), self._limit)

    def trim(self, limit: int | None = None, spared: frozenset[str] = frozenset()) -> Usage:
        """Delete the least recently used files of caches until the usage is below the limit.

        Args:
            limit: [bytes]; the one of this object where it is None.
            spared: paths that are not deleted.
        """
        now, dropped = self.usage(), 0
        excess = now.used - (self._limit if limit is None else limit)
        for path, size, _ in sorted(self._cached(), key=lambda file: file[2]):
            if excess <= dropped:
                break
            if str(path) in spared:
                continue
            with contextlib.suppress(OSError):
                path.unlink()
                dropped += size
        return Usage(now.used - dropped, now.caches - dropped, self._limit, dropped)

    def _cached(self) -> list[tuple[Path, int, float]]:
        return [file for folder in CACHES for file in _files(self._runs / folder)]


def keep_meshes(runs: Path) -> None:
    """Store the meshes of shapes below the runs folder, for this process and all that it starts;
    nothing where there is no such folder.
    """
    if runs.is_dir():
        os.environ.setdefault(FOLDER, str((runs / MESHES).resolve()))


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder."""
    return sum(size for _, size, _ in _files(folder))


def _files(folder: Path) -> list[tuple[Path, int, float]]:
    """Files below a folder with size [bytes] and time of the last use [s since 1970]."""
    files = []
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place) / name
            with contextlib.suppress(OSError):
                known = path.lstat()
                files.append((path, known.st_size, max(known.st_mtime, known.st_atime)))
    return files
