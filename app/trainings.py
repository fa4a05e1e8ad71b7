"""Trainings on disk, below the runs folder, and the job that makes one; with a run the corrected model gets into its scene, too."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from app.kept import Kept
from app.runs import CORRECTIONS, Run, Runs
from core.progress import Report, part

__all__ = ["FOLDER", "STORE", "Trainings", "train"]

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
        """The folder of the newest finished training on a dataset's model: baseline, true, or extended of a run."""
        for name in self.finished():
            asked = self.asked(name)
            if (asked.get("dataset"), asked.get("model"), asked.get("run")) == (str(dataset.resolve()), model, run):
                return self.folder / name
        return None


def train(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """The job: train on `request["dataset"]` as `request["training"]` asks; the folder has the name of the job.

    A job that is done once more goes on where it was.
    """
    from core.dataset import open_dataset  # noqa: PLC0415 (heavy)
    from core.evaluation.training import Wanted, train_network  # noqa: PLC0415 (heavy)

    runs, name = Path(request["runs"]), str(request.get("folder") or Path(request["scratch"]).name)
    trainings, dataset = Trainings(runs), open_dataset(Path(request["dataset"]))
    run = Runs(runs).get(request["run"]) if request.get("run") else None
    summary = train_network(
        dataset, Wanted.from_json(request["training"]), trainings.folder / name, store=trainings.store,
        model=None if run is None else run.model, run=None if run is None else run.name, truth=request.get("truth"),
        workers=int(request["workers"]),
        report=part(report, 0.0, 1.0 if run is None else 0.85),
    )  # fmt: skip
    if run is not None:
        _show(run, dataset, trainings.folder / name, runs, part(report, 0.85, 1.0))
    return {"training": name, "error": summary["validation_error_mm"], "without": summary["validation_error_without_mm"]}


def _show(run: Run, dataset: Any, training: Path, runs: Path, report: Report) -> None:
    """The corrected model beside the others of a run."""
    from core.evaluation.networks import Network  # noqa: PLC0415 (heavy)
    from core.evaluation.recording import record_corrections  # noqa: PLC0415 (heavy)

    frames = {name: run.replay(name)["cloud_index"] for name in run.sequences}
    if frames:
        model = json.loads((run.path / "model.json").read_text())
        record_corrections(dataset, model, Network.load(training), frames, runs / CORRECTIONS / run.name, report)
