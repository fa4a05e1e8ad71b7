"""A dataset replayed as stated and with effects of one's own choice, in the form of a run, so that
it is seen like a diagnosis.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset
from palpate.effects import Effect
from palpate.effects.base import with_effects
from palpate.foundation.errors import DatasetError
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, silent
from palpate.measurement.phantom_drift import align_sequences
from palpate.measurement.segmentation import cleaner_for
from palpate.measurement.tool_pose import find_shaft_axis
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.record_sequence import record
from palpate.registration.registration import register, setup_from

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
    """Replay these sequences (all with clouds where none is named) into the run folder `out`;
    returns frames without equilibrium.

    "raw" of the recordings is the stated setup, "extended" the one with the effects. EffectError
    for effects that do not fit the setup, DatasetError for sequences without clouds.
    """
    names = tuple(dict.fromkeys(sequences)) or tuple(
        name for name in dataset.sequences if len(dataset.sequence(name))
    )
    for name in names:
        if not len(dataset.sequence(name)):
            raise DatasetError(
                f"{name} has no clouds to compare with; choose other sequences",
                file=f"sequences/{name}",
            )
    if not names:
        raise DatasetError(
            "no sequence has clouds, and a replay is compared with clouds; record some",
            key="sequences",
        )
    report(0.0, "relating robot, camera and phantom")
    dataset, registration = align_sequences(dataset, register(dataset))
    stated = setup_from(dataset, registration)
    found = with_effects(stated, effects) if effects else stated
    cleaner, shaft = (
        cleaner_for(dataset, registration),
        find_shaft_axis(dataset, registration.repaired),
    )
    grid = PAGE_GRID.for_tool(stated.tool.radius)
    (out / "replays").mkdir(parents=True)
    (out / "pictures").mkdir()
    with ProcessPool(min(workers, len(names))) as pool:
        tasks = [
            pool.submit(
                record,
                dataset.sequence(name),
                stated,
                found,
                cleaner,
                shaft,
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
    registered = {"registration": dataset.accepted.to_json()} if dataset.accepted else {}
    warnings = [
        *registration.warnings,
        *([f"{failed} frames found no equilibrium."] if failed else []),
    ]
    said = {
        "format": 1,
        "dataset": dataset.name,
        "verdict": "replay",
        "causes": [_cause(one) for one in effects],
        "warnings": warnings,
    }
    model = {
        "format": 1,
        "version": 1,
        "dataset": dataset.name,
        "parent": None,
        "fitted_on": [],
        "effects": [one.to_json() for one in effects],
        "setup": found.as_dict(),
        **registered,
    }
    (out / "model.json").write_text(json.dumps(model, indent=1))
    (out / "report.json").write_text(json.dumps({**said, **registered}, indent=1))
    return failed


def _cause(effect: Effect) -> dict[str, Any]:
    units = {item.name: item.unit for item in effect.parameters()}
    values = effect.to_json()["parameters"]
    return {
        "effect": effect.name,
        "parameters": {
            name: {"value": value, "unit": units[name]} for name, value in values.items()
        },
    }
