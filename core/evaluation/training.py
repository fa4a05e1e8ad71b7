"""A training from a dataset: samples of one model are made once, kept for all trainings on it, and learned from.

folder/             one training
  request.json      what is trained, on what
  checkpoint.pt     where it is; a training that was stopped goes on from there
  history.json      [loss, validation error [mm], rate] of each epoch so far
  network.pt        the best network, and training.json what came of it, once it is finished
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from core.dataset import Dataset
from core.diagnosis.kept import kept_setup
from core.errors import CorrectionError, RunError
from core.progress import Report, part, silent
from core.registration import register, setup_from
from core.setup import Setup

if TYPE_CHECKING:
    from core.correction import Samples

__all__ = ["REQUEST", "SUMMARY", "Wanted", "train_network"]

REQUEST, SUMMARY = "request.json", "training.json"
_SAMPLING = 0.4
"""Share of the time that replaying takes, for the progress."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is trained.

    Attributes:
        spec: see `core.correction.request.TrainingSpec`, plain values; what is left out has its default.
        nodes: of the grid that is sampled, along x, y, z. every: each how many clouds one is learned from. points: kept of a cloud.
    """

    spec: Mapping[str, Any] = field(default_factory=dict)
    nodes: tuple[int, int, int] = (13, 5, 5)
    every: int = 1
    points: int = 1024

    def __post_init__(self) -> None:
        for key, value, low, high in (("every", self.every, 1, 10_000), ("points", self.points, 20, 100_000)):
            if not low <= value <= high:
                raise CorrectionError(f"{key} = {value}; expected {low} to {high}", key=key, value=value, low=low, high=high)

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"spec": dict(self.spec), "nodes": list(self.nodes), "every": self.every, "points": self.points}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The inverse."""
        nx, ny, nz = data.get("nodes", (13, 5, 5))
        return cls(spec=data.get("spec", {}), nodes=(nx, ny, nz), every=data.get("every", 1), points=data.get("points", 1024))


def train_network(
    dataset: Dataset,
    wanted: Wanted,
    folder: Path,
    *,
    store: Path,
    model: Mapping[str, Any] | None = None,
    run: str | None = None,
    setup: Setup | None = None,
    workers: int = 2,
    report: Report = silent,
) -> dict[str, Any]:
    """Train on the stated model of a dataset, or on another one; returns what training.json says.

    Args:
        store: folder of samples for all trainings. model: model.json of a diagnosis, of the `run` of this name.
        setup: instead of both.

    What was begun in `folder` goes on, and what is finished there is returned. RunError where another training is in it,
    CorrectionError for values or data that cannot be trained with.
    """
    from core.correction import Split, TrainingSpec, train  # noqa: PLC0415 (heavy)

    spec = TrainingSpec.from_json(wanted.spec)
    _claim(
        folder, {**wanted.to_json(), "dataset": str(dataset.path.resolve()), "model": None if model is None else model["effects"]}
    )
    if (folder / SUMMARY).is_file():
        return dict(json.loads((folder / SUMMARY).read_text()))
    samples = _samples(dataset, wanted, store, model, setup, workers, part(report, 0.0, _SAMPLING))
    trained = train(samples, Split.of(samples), spec, folder, part(report, _SAMPLING, 1.0))
    about = trained.about
    summary = {
        "format": 1, "dataset": dataset.name, "kind": spec.network.kind, "samples": len(samples), "sequences": about["split"],
        "epochs": len(about["history"]), "best_epoch": about["epoch"], "validation_error_mm": about["error"],
        "validation_error_without_mm": about["raw_error"], "history": about["history"],
    }  # fmt: skip
    _write(folder / SUMMARY, summary)
    return summary


def _samples(
    dataset: Dataset,
    wanted: Wanted,
    store: Path,
    model: Mapping[str, Any] | None,
    setup: Setup | None,
    workers: int,
    report: Report,
) -> Samples:
    """Made once for each model, motion and density of a dataset."""
    from core.correction import make_samples, open_samples, recorder_for  # noqa: PLC0415 (heavy)

    report(0.0, "relating robot, camera and phantom")
    registration = register(dataset)
    stated = setup_from(dataset, registration)
    own = setup or (stated if model is None else kept_setup(stated, model))
    recorder = recorder_for(dataset, setup=own, nodes=wanted.nodes, points=wanted.points, registration=registration)
    names = [name for name in (*dataset.config.train, *dataset.config.validation) if len(dataset.sequence(name))]
    said = [str(dataset.path.resolve()), own.as_dict(), repr(recorder.grid), wanted.nodes, wanted.every, wanted.points, names]
    folder = store / hashlib.sha256(json.dumps(said, sort_keys=True, default=repr).encode()).hexdigest()[:16]
    if not folder.is_dir():
        try:
            return make_samples(folder, recorder, sequences=names, every=wanted.every, workers=workers, report=report)
        except RunError:
            if not folder.is_dir():  # another training may have made the same in the meantime
                raise
    return open_samples(folder)


def _claim(folder: Path, said: dict[str, Any]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / REQUEST
    if file.is_file() and json.loads(file.read_text()) != said:
        raise RunError(f"{folder} has another training; name another folder", file=REQUEST)
    _write(file, said)


def _write(file: Path, value: Any) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text(json.dumps(value, indent=1) + "\n")
    os.replace(aside, file)
