"""Training of a correction network on a dataset.

Samples of one model are made once and used by all trainings on it.

folder/             one training
  request.json      what is trained, and on which model of which dataset
  checkpoint.pt     state of the training, from which it resumes
  history.json      [loss, validation error [mm], rate] of each epoch so far
  network.pt        the best network, once finished
  training.json     the summary, once finished
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from palpate.dataset import Dataset
from palpate.dataset.provenance import check_data, check_unchanged, dataset_digest, made_from
from palpate.effects.base import with_effects
from palpate.experiment import Experiment
from palpate.foundation.errors import CorrectionError, RunError
from palpate.foundation.progress import Report, part, silent
from palpate.mesh.stored_label import stored_label
from palpate.recording.saved_model import effects_from, setup_of_model
from palpate.setup.setup import Setup

if TYPE_CHECKING:
    from palpate.correction import Samples

__all__ = ["REQUEST", "SUMMARY", "TrainingPlan", "complete_samples", "train_network"]

REQUEST, SUMMARY = "request.json", "training.json"
_SAMPLING = 0.4
"""Share of the time that making the samples takes, for the progress [1]."""


@dataclass(frozen=True, kw_only=True)
class TrainingPlan:
    """A training and the samples that it uses.

    Attributes:
        spec: plain values of a `palpate.correction.training_spec.TrainingSpec`; missing keys have
            their defaults.
        nodes: points of the sampled grid along x, y, z.
        every: interval between the clouds that are used.
        points: most points of a cloud.
    """

    spec: Mapping[str, Any] = field(default_factory=dict)
    nodes: tuple[int, int, int] = (13, 5, 5)
    every: int = 1
    points: int = 1024

    def __post_init__(self) -> None:
        for key, value, low, high in (
            ("every", self.every, 1, 10_000),
            ("points", self.points, 20, 100_000),
        ):
            if not low <= value <= high:
                raise CorrectionError(
                    f"{key} = {value}; expected {low} to {high}",
                    key=key,
                    value=value,
                    low=low,
                    high=high,
                )

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "spec": dict(self.spec),
            "nodes": list(self.nodes),
            "every": self.every,
            "points": self.points,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the plan that `to_json` wrote; missing keys have their defaults."""
        nx, ny, nz = data.get("nodes", (13, 5, 5))
        return cls(
            spec=data.get("spec", {}),
            nodes=(nx, ny, nz),
            every=data.get("every", 1),
            points=data.get("points", 1024),
        )


def train_network(
    dataset: Dataset,
    plan: TrainingPlan,
    folder: Path,
    *,
    store: Path,
    model: Mapping[str, Any] | None = None,
    run: str | None = None,
    truth: Sequence[Mapping[str, Any]] | None = None,
    setup: Setup | None = None,
    workers: int = 2,
    report: Report = silent,
) -> dict[str, Any]:
    """Train on the stated model of a dataset or on another one; return the summary.

    A training that was interrupted in `folder` resumes; the summary of a finished one is returned.

    Args:
        dataset: the dataset.
        plan: the training.
        folder: folder of the training.
        store: folder of samples for all trainings.
        model: model.json of a diagnosis, to train on its extended model.
        run: name of this diagnosis.
        truth: effects of a virtual dataset's truth file, to train on the true model.
        setup: setup to train on, instead of all these.
        workers: number of processes that make samples.
        report: receives the progress.

    Raises RunError where the folder holds another training, CorrectionError for values or data
    that cannot be trained with.
    """
    from palpate.correction import Split, TrainingSpec, train

    spec = TrainingSpec.from_json(plan.spec)
    effects = truth if model is None else model["effects"]
    on = "extended" if model is not None else "baseline" if truth is None else "true"
    source = {
        "dataset": str(dataset.path.resolve()),
        "run": run,
        "model": on,
        "effects": None if effects is None else list(effects),
    }
    made = made_from(dataset.path)
    _claim(folder, {**plan.to_json(), **source}, made)
    if (folder / SUMMARY).is_file():
        return dict(json.loads((folder / SUMMARY).read_text()))
    experiment = Experiment.of(dataset)
    if setup is None:
        setup = _setup(experiment.stated, model, truth)
    samples = _samples(experiment, plan, store, setup, workers, part(report, 0.0, _SAMPLING))
    check_unchanged(dataset.path, made)
    trained = train(samples, Split.of(samples), spec, folder, part(report, _SAMPLING, 1.0))
    about = trained.about
    summary = {
        "format": 1,
        "dataset": dataset.name,
        "folder": dataset.path.resolve().name,
        "kind": spec.network.kind,
        "samples": len(samples),
        "sequences": about["split"],
        "epochs": len(about["history"]),
        "best_epoch": about["epoch"],
        "validation_error_mm": about["error"],
        "validation_error_without_mm": about["raw_error"],
        "history": about["history"],
        "made_from": {**made, "seed": spec.seed},
    }
    _write(folder / SUMMARY, summary)
    return summary


def _setup(
    stated: Setup, model: Mapping[str, Any] | None, truth: Sequence[Mapping[str, Any]] | None
) -> Setup:
    if model is not None:
        return setup_of_model(stated, model)
    return stated if truth is None else with_effects(stated, effects_from(truth))


def _samples(
    experiment: Experiment,
    plan: TrainingPlan,
    store: Path,
    setup: Setup,
    workers: int,
    report: Report,
) -> Samples:
    """Return the samples of a model; made where the store does not have them."""
    from palpate.correction import make_samples, recorder_for

    dataset = experiment.dataset
    recorder = recorder_for(
        dataset, setup=setup, nodes=plan.nodes, points=plan.points, experiment=experiment
    )
    names = [
        name
        for name in (*dataset.config.train, *dataset.config.validation)
        if len(dataset.sequence(name))
    ]
    content = [
        str(dataset.path.resolve()),
        dataset_digest(dataset.path),
        setup.as_dict(),
        stored_label(recorder.grid),
        plan.nodes,
        plan.every,
        plan.points,
        names,
    ]
    digest = hashlib.sha256(json.dumps(content, sort_keys=True, default=repr).encode()).hexdigest()
    folder = store / digest[:16]
    known = complete_samples(folder)
    if known is not None:
        return known
    try:
        return make_samples(
            folder, recorder, sequences=names, every=plan.every, workers=workers, report=report
        )
    except RunError:
        known = complete_samples(folder)  # another training may have made them in the meantime
        if known is None:
            raise
        return known


def complete_samples(folder: Path) -> Samples | None:
    """Return the samples in a folder; None where there are none.

    Samples with missing files, which a full cache deletes one by one, are removed.
    """
    from palpate.correction import open_samples
    from palpate.correction.samples.sample_arrays import ARRAYS

    if not folder.is_dir():
        return None
    try:
        samples = open_samples(folder)
        for sequence in samples.sequences:
            for name in ARRAYS:
                samples.array(sequence, name)
    except RunError:
        shutil.rmtree(folder, ignore_errors=True)
        return None
    return samples


def _claim(folder: Path, content: dict[str, Any], made: dict[str, Any]) -> None:
    """Write the request, or compare it with the one that is there, and the data with its data."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / REQUEST
    if file.is_file():
        known = json.loads(file.read_text())
        before = known.pop("made_from", {})
        if known != content:
            raise RunError(f"{folder} holds another training; name another folder", file=REQUEST)
        if not (folder / SUMMARY).is_file():
            check_data(before, made, "training", folder.name)
        made = before or made
    _write(file, {**content, "made_from": made})


def _write(file: Path, value: Any) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text(json.dumps(value, indent=1) + "\n")
    os.replace(aside, file)
