"""Trainings on disk, below the runs folder, and the job that makes one; with a run the corrected
model gets into its scene, too.
"""

from __future__ import annotations

from pathlib import Path

from palpate.app.storage.result_folder import Kept

__all__ = ["FOLDER", "STORE", "Trainings"]

FOLDER, STORE = "trainings", ".samples"


class Trainings(Kept):
    """The folder of trainings; `store` keeps the samples that all of them share."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs, "training", FOLDER, "request.json", "training.json")

    @property
    def store(self) -> Path:
        """Of samples by their content."""
        return self.folder / STORE

    def history(self, name: str) -> list[list[float]]:
        """Of each epoch so far the loss, the validation error [mm] and the learning rate."""
        found = self.read(name, "history.json")
        return list(found) if found is not None else (self.found(name) or {}).get("history", [])

    def newest(self, dataset: Path, model: str, run: str | None = None) -> Path | None:
        """The folder of the newest finished training on a dataset's model: baseline, true, or
        extended of a run.
        """
        for name in self.finished():
            asked = self.asked(name)
            if (asked.get("dataset"), asked.get("model"), asked.get("run")) == (
                str(dataset.resolve()),
                model,
                run,
            ):
                return self.folder / name
        return None
