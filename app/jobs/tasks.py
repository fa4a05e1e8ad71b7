"""Functions of the long jobs: a plain request and a progress callback in, a plain result out."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.app.storage.evaluation_store import EvaluationStore, networks_for
from palpate.app.storage.run_store import CORRECTIONS, Run, RunStore
from palpate.app.storage.sweep_store import SweepStore
from palpate.app.storage.training_store import TrainingStore
from palpate.foundation.errors import RunError
from palpate.foundation.progress import Report, part

if TYPE_CHECKING:
    from palpate.dataset.accepted_registration import AcceptedRegistration

__all__ = ["TARGETS", "diagnose", "diagnose_into", "evaluate", "sweep", "train"]

TARGETS = {
    "diagnosis": "palpate.app.jobs.tasks:diagnose",
    "sweep": "palpate.app.jobs.tasks:sweep",
    "training": "palpate.app.jobs.tasks:train",
    "import": "palpate.app.jobs.import_dataset:import_dataset",
    "look": "palpate.app.jobs.look_jobs:look",
    "registration": "palpate.app.jobs.short_tasks:register",
    "replay": "palpate.app.jobs.short_tasks:replay",
    "export": "palpate.app.jobs.short_tasks:export",
    "evaluation": "palpate.app.jobs.tasks:evaluate",
}


def diagnose(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Diagnose `request["dataset"]`; the run folder, below `request["runs"]`, has the name of the
    scratch folder.

    A repeated job whose first attempt was interrupted after its run was in place returns that run.
    """
    from palpate.dataset.accepted_registration import AcceptedRegistration

    registered = request.get("registration")
    scratch = Path(request["scratch"])
    run = Path(request["runs"]) / scratch.name
    if run.is_dir():
        written = json.loads((run / "report.json").read_text())
        return {"run": run.name, "verdict": written["verdict"]}
    result = diagnose_into(
        Path(request["dataset"]),
        run,
        scratch,
        workers=int(request["workers"]),
        seed=int(request["seed"]),
        report=report,
        accepted=AcceptedRegistration.from_json(registered) if registered else None,
        tolerance=request.get("tolerance"),
    )
    return {"run": run.name, "verdict": result["verdict"]}


def diagnose_into(
    dataset: Path,
    run: Path,
    scratch: Path,
    *,
    workers: int,
    seed: int,
    report: Report,
    accepted: AcceptedRegistration | None = None,
    tolerance: float | None = None,
) -> dict[str, Any]:
    """Diagnose into `scratch`, write the origin, and rename the result to `run`; returns the
    report.

    `accepted` is a registration of the camera that replaces the automatic one; `tolerance` [m] as
    of `palpate.diagnosis.pipeline.diagnose`.
    """
    from palpate.dataset import open_dataset
    from palpate.diagnosis.pipeline import diagnose as find_cause

    if run.exists():
        raise RunError(f"{run} exists already; name another folder or move it away", file=str(run))
    began, since = time.time(), time.monotonic()
    made = scratch / run.name
    opened = open_dataset(dataset).registered(accepted)
    result = find_cause(
        opened, made, workers=workers, report=report, seed=seed, tolerance=tolerance
    )
    splits = {
        name: split
        for split in ("train", "validation", "test")
        for name in getattr(opened.config, split)
    }
    origin = {
        "dataset": str(dataset.resolve()),
        "created": began,
        "seconds": time.monotonic() - since,
        "seed": seed,
        "splits": splits,
        "made_from": result["made_from"],
    }
    (made / "origin.json").write_text(json.dumps(origin, indent=1))
    run.parent.mkdir(parents=True, exist_ok=True)
    os.rename(made, run)
    return dict(result)


def sweep(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Sweep `request["dataset"]` by `request["sweep"]`; the folder has the name of the job."""
    from palpate.dataset import open_dataset
    from palpate.dataset.accepted_registration import AcceptedRegistration
    from palpate.sweep.run_sweep import run_sweep
    from palpate.sweep.sweep_spec import SweepSpec

    registered = request.get("registration")
    dataset = open_dataset(Path(request["dataset"])).registered(
        AcceptedRegistration.from_json(registered) if registered else None
    )
    sweeps, name = SweepStore(Path(request["runs"])), Path(request["scratch"]).name
    summary = run_sweep(
        dataset,
        SweepSpec.from_json(request["sweep"]),
        sweeps.folder / name,
        store=sweeps.replay_cache,
        workers=int(request["workers"]),
        scheduler=request["scheduler"],
        report=report,
    )
    return {"sweep": name, "points": summary["points"], "failed": summary["failed"]}


def train(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Train on `request["dataset"]` by `request["training"]`; the folder has the name of the job. A
    repeated job resumes.
    """
    from palpate.dataset import open_dataset
    from palpate.evaluation.train_network import TrainingPlan, train_network

    runs, name = Path(request["runs"]), str(request.get("folder") or Path(request["scratch"]).name)
    trainings, dataset = TrainingStore(runs), open_dataset(Path(request["dataset"]))
    run = RunStore(runs).get(request["run"]) if request.get("run") else None
    summary = train_network(
        dataset,
        TrainingPlan.from_json(request["training"]),
        trainings.folder / name,
        store=trainings.sample_cache,
        model=None if run is None else run.model,
        run=None if run is None else run.name,
        truth=request.get("truth"),
        workers=int(request["workers"]),
        report=part(report, 0.0, 1.0 if run is None else 0.85),
    )
    if run is not None:
        _show(run, dataset, trainings.folder / name, runs, part(report, 0.85, 1.0))
    return {
        "training": name,
        "error": summary["validation_error_mm"],
        "without": summary["validation_error_without_mm"],
    }


def _show(run: Run, dataset: Any, training: Path, runs: Path, report: Report) -> None:
    """Record the corrected model for the frames of a run."""
    from palpate.evaluation.loaded_network import LoadedNetwork
    from palpate.evaluation.record_corrections import record_corrections

    frames = {name: run.replay(name)["cloud_index"] for name in run.sequences}
    if frames:
        model = json.loads((run.path / "model.json").read_text())
        record_corrections(
            dataset,
            model,
            LoadedNetwork.load(training),
            frames,
            runs / CORRECTIONS / run.name,
            report,
        )


def evaluate(request: Mapping[str, Any], report: Report) -> dict[str, Any]:
    """Evaluate `request["dataset"]`; the folder has the name of the job."""
    from palpate.dataset import open_dataset
    from palpate.evaluation.run_evaluation import EvaluationSpec
    from palpate.evaluation.run_evaluation import evaluate as climb

    runs = Path(request["runs"])
    name, dataset = (
        str(request.get("folder") or Path(request["scratch"]).name),
        Path(request["dataset"]),
    )
    run = RunStore(runs).get(request["run"]) if request.get("run") else None
    networks = networks_for(
        TrainingStore(runs),
        dataset,
        request.get("run"),
        list(request.get("trainings", ())),
        request.get("truth") is not None,
    )
    spec = EvaluationSpec(
        model=None if run is None else run.model,
        truth=request.get("truth"),
        networks=networks,
        feedback=request.get("feedback", "none"),
    )
    out = EvaluationStore(runs).folder / name
    summary = climb(
        open_dataset(dataset),
        spec,
        out,
        workers=int(request["workers"]),
        seed=int(request["seed"]),
        report=report,
    )
    return {"evaluation": name, "sentence": summary["sentence"]}
