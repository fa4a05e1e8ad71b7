"""What the runs folder takes on the disk, and room where it is too much: caches only, the oldest
first, never a result.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

from palpate.app.storage.dataset_import import UPLOADS
from palpate.app.storage.sweep_store import FOLDER as SWEEPS
from palpate.app.storage.sweep_store import STORE as REPLAYS
from palpate.app.storage.training_store import FOLDER as TRAININGS
from palpate.app.storage.training_store import STORE as SAMPLES

__all__ = ["CACHES", "Disk", "Usage"]

CACHES = (f"{SWEEPS}/{REPLAYS}", f"{TRAININGS}/{SAMPLES}", UPLOADS)
"""Folders below the runs of what can be worked out, or sent, once more."""


@dataclass(frozen=True)
class Usage:
    """Bytes below the runs folder: all, those of caches, and how many may be; what was dropped just
    now.
    """

    used: int
    caches: int
    limit: int
    dropped: int = 0


class Disk:
    """The runs folder, kept below a limit [bytes] as far as dropping caches goes."""

    def __init__(self, runs: Path, limit: int) -> None:
        self._runs, self._limit = runs, limit

    def usage(self) -> Usage:
        """As it is now."""
        return Usage(
            sum(size for _, size, _ in _files(self._runs)),
            sum(size for _, size, _ in self._cached()),
            self._limit,
        )

    def trim(self, limit: int | None = None, spared: frozenset[str] = frozenset()) -> Usage:
        """Drop the files of caches that were used longest ago until all is below the limit;
        `spared` paths are kept.
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


def _files(folder: Path) -> list[tuple[Path, int, float]]:
    """Files below a folder with size [bytes] and when they were last used [s]."""
    found = []
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place) / name
            with contextlib.suppress(OSError):
                known = path.lstat()
                found.append((path, known.st_size, max(known.st_mtime, known.st_atime)))
    return found
