"""Results that take room: how much each takes, and their deletion."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from palpate.app.http_errors import Missing
from palpate.app.storage.disk_usage import size_of
from palpate.app.storage.evaluation_store import EvaluationStore
from palpate.app.storage.look_store import LookStore
from palpate.app.storage.result_store import ResultStore
from palpate.app.storage.run_store import RunStore
from palpate.app.storage.sweep_store import SweepStore
from palpate.app.storage.training_store import TrainingStore

__all__ = ["StoredResult", "StoredResults"]


@dataclass(frozen=True)
class StoredResult:
    """A result on disk.

    Attributes:
        kind: "run", "sweep", "training", "evaluation" or "look".
        name: of its folder.
        bytes: of all its files.
        created: time of the last change of its first file [s since 1970].
    """

    kind: str
    name: str
    bytes: int
    created: float


class StoredResults:
    """The results of all kinds below the folder `runs`."""

    def __init__(self, runs: Path) -> None:
        self._stores: Sequence[ResultStore] = (
            RunStore(runs),
            SweepStore(runs),
            TrainingStore(runs),
            EvaluationStore(runs),
            LookStore(runs),
        )

    def largest(self, most: int) -> list[StoredResult]:
        """The results that take most room, the largest first."""
        found = [
            StoredResult(store.kind, name, sum(map(size_of, store.folders(name))), created)
            for store in self._stores
            for name, created in store.created().items()
        ]
        return sorted(found, key=lambda one: -one.bytes)[:most]

    def store(self, kind: str) -> ResultStore:
        """The store of a kind; raises Missing for another kind."""
        for store in self._stores:
            if store.kind == kind:
                return store
        kinds = ", ".join(store.kind for store in self._stores)
        raise Missing(f"there are no results of the kind {kind}; known are {kinds}", kind=kind)

    def delete(self, kind: str, name: str) -> None:
        """Delete a result for good; raises Missing where there is none of this name.

        Each folder is renamed first, so that nobody reads a result of which a part is gone.
        """
        store = self.store(kind)
        if not store.has_begun(name):
            raise store.missing(name)
        for folder in store.folders(name):
            if folder.is_dir():
                aside = folder.with_name(f".deleted-{uuid4().hex}")
                try:
                    os.rename(folder, aside)
                except FileNotFoundError:  # another request has deleted it
                    raise store.missing(name) from None
                shutil.rmtree(aside, ignore_errors=True)
