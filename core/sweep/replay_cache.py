"""Cache of replay results on disk, each stored under a digest of its inputs."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from uuid import uuid4

from palpate.foundation.rounding import rounded
from palpate.foundation.source_digest import source_digest
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup
from palpate.sweep.sweep_error import TOLERANCE, ReplayResult

__all__ = ["ReplayCache", "replay_key"]


def replay_key(setup: Setup, digest: str, grid: Meshing) -> str:
    """Return the cache key of one setup on one sequence.

    Args:
        setup: the setup of the replay.
        digest: `SweepSequence.digest` of the sequence.
        grid: the mesh protocol.

    Equal inputs under the same version of the code have equal keys.
    """
    content = {"setup": rounded(setup.as_dict()), "watched": digest, "grid": repr(grid)}
    content |= {"tolerance": TOLERANCE, "code": source_digest()}
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=repr).encode()).hexdigest()


class ReplayCache:
    """A folder with one small file per replay; several sweeps may use it at the same time.

    Args:
        folder: where the files are.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> ReplayResult | None:
        """Return the stored result; None where there is none or it cannot be read."""
        path = self._path(key)
        try:
            result = ReplayResult.from_json(json.loads(path.read_text()))
            os.utime(path)  # the least recently used files are deleted first
            return result
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def put(self, key: str, result: ReplayResult) -> None:
        """Store a result atomically."""
        path = self._path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_name(f".{uuid4().hex}")
        aside.write_text(json.dumps(result.to_json()))
        os.replace(aside, path)

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.json"
