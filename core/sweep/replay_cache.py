"""Replays on disk, each under the digest of what it follows from."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any
from uuid import uuid4

from palpate.foundation.source_digest import source_digest
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup
from palpate.sweep.sweep_error import TOLERANCE, ReplayResult

__all__ = ["ReplayCache", "replay_key"]

_DIGITS = 9


def replay_key(setup: Setup, digest: str, grid: Meshing) -> str:
    """Of one setup on one sequence (`SweepSequence.digest`): the same for whatever gives the same replay
    under the same code.
    """
    said = {"setup": _rounded(setup.as_dict()), "watched": digest, "grid": repr(grid)}
    said |= {"tolerance": TOLERANCE, "code": source_digest()}
    return hashlib.sha256(json.dumps(said, sort_keys=True, default=repr).encode()).hexdigest()


def _rounded(value: Any) -> Any:
    """Numbers of the registrations differ in their last digits from run to run; a billionth (of a
    metre) is no other setup.
    """
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    return [_rounded(one) for one in value] if isinstance(value, (list, tuple)) else value


class ReplayCache:
    """One small file for each replay, below `folder`; several sweeps may share it at the same
    time."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> ReplayResult | None:
        """What is known; a file that cannot be read is as good as none."""
        path = self._path(key)
        try:
            found = ReplayResult.from_json(json.loads(path.read_text()))
            os.utime(path)  # what is used last is dropped last
            return found
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def put(self, key: str, found: ReplayResult) -> None:
        """Keep it: whole or not at all."""
        path = self._path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.with_name(f".{uuid4().hex}")
        aside.write_text(json.dumps(found.to_json()))
        os.replace(aside, path)

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.json"
