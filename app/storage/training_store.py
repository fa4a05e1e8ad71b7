"""Trainings of correction networks on disk, below the runs folder."""

from __future__ import annotations

import json
from pathlib import Path

from palpate.app.storage.result_store import NAME, ResultStore, unusable

__all__ = ["SAMPLE_CACHE", "TRAININGS", "TrainingStore"]

TRAININGS, SAMPLE_CACHE = "trainings", ".samples"


class TrainingStore(ResultStore):
    """The folder of trainings."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs / TRAININGS, "training", "request.json", "training.json")

    @property
    def sample_cache(self) -> Path:
        """Folder of training samples by their content, shared by all trainings."""
        return self.folder / SAMPLE_CACHE

    def history(self, name: str) -> list[list[float]]:
        """Loss, validation error [mm] and learning rate of each finished epoch."""
        path = self.folder / name / "history.json"
        if not NAME.fullmatch(name) or not path.is_file():
            return list((self.result(name) or {}).get("history", []))
        try:
            return list(json.loads(path.read_text()))
        except (OSError, ValueError) as error:
            raise unusable(path.name, f"cannot be read ({error})", self.kind, name) from error

    def newest(self, dataset: Path, model: str, run: str | None = None) -> Path | None:
        """Folder of the newest finished training on one model of a dataset.

        Args:
            dataset: the dataset's folder.
            model: baseline, true, or extended.
            run: the run whose extended model was corrected.
        """
        expected = (str(dataset.resolve()), model, run)
        for name in self.finished():
            request = self.request(name)
            if (request.get("dataset"), request.get("model"), request.get("run")) == expected:
                return self.folder / name
        return None
