"""A virtual push with a tool larger than stated, and the run folder that names it, without the
minutes of a diagnosis.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from made_datasets import copy_dataset

from palpate.effects import effect_named
from palpate.experiment import Experiment
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.record_sequence import record
from palpate.synthetic import HiddenEffect, Scenario

__all__ = ["RADIUS", "SEQUENCE", "write_recorded_run"]

RADIUS = 0.0075
SEQUENCE = "poke-top-01"
_SCENARIO = Scenario(
    effects=(HiddenEffect("tool_radius", {"radius": RADIUS}),),
    sequences=(SEQUENCE,),
    fine=4.5e-3,
    density=1500,
    rate=3.0,
    robot_rate=200.0,
    noise=0.15e-3,
)


def write_recorded_run(datasets: Path, runs: Path) -> Path:
    """Make the dataset `datasets`/large-tool and the run `runs`/large-tool-1; returns the run's
    folder.
    """
    folder, run = datasets / "large-tool", runs / "large-tool-1"
    copy_dataset(folder, _SCENARIO, seed=3)
    experiment = Experiment.of(folder)
    dataset, stated = experiment.dataset, experiment.stated
    effect = effect_named("tool_radius")(radius=RADIUS)  # type: ignore[call-arg]
    found = effect.apply(stated)
    (run / "replays").mkdir(parents=True)
    grid = PAGE_GRID.for_tool(stated.tool.radius)
    record(
        dataset.sequence(SEQUENCE),
        stated,
        found,
        experiment.cleaner,
        experiment.shaft,
        grid,
        run / "replays" / f"{SEQUENCE}.npz",
    )
    parameters = {
        "radius": {"value": RADIUS, "unit": "m", "low": RADIUS - 1e-4, "high": RADIUS + 1e-4}
    }
    report = {
        "format": 1,
        "dataset": dataset.name,
        "verdict": "found",
        "causes": [{"effect": "tool_radius", "probability": 1.0, "parameters": parameters}],
    }
    origin = {
        "dataset": str(folder),
        "created": 1.0,
        "seconds": 1.0,
        "seed": 0,
        "splits": {SEQUENCE: "test"},
    }
    model = {"format": 1, "effects": [effect.to_json()], "setup": found.as_dict(), "fitted_on": []}
    for name, value in (("report", report), ("origin", origin), ("model", model)):
        (run / f"{name}.json").write_text(json.dumps(value))
    seen = np.zeros((0, 3))
    np.savez(
        run / "patterns.npz",
        centres=seen,
        normals=seen,
        measured=np.zeros(0),
        predicted=np.zeros(0),
    )
    return run
