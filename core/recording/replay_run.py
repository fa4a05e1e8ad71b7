"""Replay of a dataset as stated and with chosen effects, stored as a run like a diagnosis."""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset
from palpate.dataset.provenance import made_from
from palpate.effects import Effect
from palpate.experiment import Experiment, sequences_with_clouds
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, silent
from palpate.mesh.default_meshes import Use
from palpate.recording.record_sequence import record
from palpate.setup.setup import Setup

__all__ = ["replay_into"]


def replay_into(
    dataset: Dataset,
    out: Path,
    sequences: Sequence[str],
    effects: Sequence[Effect],
    *,
    workers: int = 2,
    report: Report = silent,
) -> int:
    """Replay sequences into the run folder `out`; returns the number of frames without equilibrium.

    "raw" of the recordings is the stated setup, "extended" the one with the effects. Raises
    EffectError for effects that do not fit the setup, DatasetError for sequences without clouds.

    Args:
        dataset: to replay.
        out: folder, which exists.
        sequences: names; empty for all with clouds.
        effects: of the extended model.
        workers: processes.
        report: progress.
    """
    names, made = sequences_with_clouds(dataset, sequences), made_from(dataset.path)
    report(0.0, "relating robot, camera and phantom")
    experiment = Experiment.of(dataset)
    stated = experiment.stated
    extended = experiment.with_effects(*effects).setup if effects else stated
    grid = experiment.mesh(Use.PAGE, names)
    (out / "replays").mkdir(parents=True)
    (out / "pictures").mkdir()
    with ProcessPool(min(workers, len(names))) as pool:
        tasks = [
            pool.submit(
                record,
                experiment.dataset.sequence(name),
                stated,
                extended,
                experiment.cleaner,
                experiment.shaft,
                grid,
                out / "replays" / f"{name}.npz",
            )
            for name in names
        ]
        for number, task in enumerate(as_completed(tasks)):
            report(
                (number + 1) / (len(names) + 1),
                f"replayed {task.result()}, {number + 1} of {len(names)}",
            )
    failed = sum(
        int((np.load(out / "replays" / f"{name}.npz")["outcome"] != 0).sum()) for name in names
    )
    warnings = [
        *experiment.warnings,
        *([f"{failed} frames found no equilibrium."] if failed else []),
    ]
    _write_run(out, dataset, extended, effects, warnings, made)
    return failed


def _write_run(
    out: Path,
    dataset: Dataset,
    extended: Setup,
    effects: Sequence[Effect],
    warnings: Sequence[str],
    made: dict[str, Any],
) -> None:
    """Write model.json and report.json of a replay, which states `made_from`."""
    registered = {"registration": dataset.accepted.to_json()} if dataset.accepted else {}
    model = {
        "format": 1,
        "version": 1,
        "dataset": dataset.name,
        "parent": None,
        "fitted_on": [],
        "effects": [one.to_json() for one in effects],
        "setup": extended.as_dict(),
        **registered,
    }
    report = {
        "format": 1,
        "dataset": dataset.name,
        "verdict": "replay",
        "causes": [_cause(one) for one in effects],
        "warnings": list(warnings),
        "made_from": made,
        **registered,
    }
    (out / "model.json").write_text(json.dumps(model, indent=1))
    (out / "report.json").write_text(json.dumps(report, indent=1))


def _cause(effect: Effect) -> dict[str, Any]:
    """An effect in the form of a cause in report.json."""
    units = {item.name: item.unit for item in effect.parameters()}
    values = effect.to_json()["parameters"]
    return {
        "effect": effect.name,
        "parameters": {
            name: {"value": value, "unit": units[name]} for name, value in values.items()
        },
    }
