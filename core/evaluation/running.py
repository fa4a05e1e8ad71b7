"""A ladder from a dataset: its test sequences under the stated model, under others, and with networks on top of each."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from core.dataset import Dataset
from core.diagnosis.hypothesis import with_effects
from core.diagnosis.kept import effects_from, kept_setup
from core.diagnosis.observations import Observations
from core.diagnosis.prediction import Prediction
from core.diagnosis.unseen import observe_each
from core.diagnosis.workers import Workers
from core.errors import DiagnosisError, RunError
from core.evaluation.corrected import corrected_prediction, tools_of
from core.evaluation.kinds import kinds_in, kinds_of_pushes
from core.evaluation.ladder import Rung, ladder
from core.evaluation.networks import Network
from core.evaluation.sentence import meaning
from core.grading import PAGE_GRID
from core.meshing import Meshing
from core.progress import Report, part, silent
from core.registration import register, setup_from
from core.setup import Setup

__all__ = ["FILE", "MODELS", "Asked", "evaluate"]

FILE = "evaluation.json"
MODELS = {"baseline": "stated model", "extended": "extended model", "true": "true effects, known to nobody"}
TEST_GROUPS, TEST_FELT = 24, 32
"""Groups of a sequence at most."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What stands on the ladder beside the stated model.

    Attributes:
        model: model.json of a diagnosis, the extended model. truth: effects as in a truth file. networks: folders of trained networks
            by the model they were trained on, "baseline", "extended" or "true".
    """

    model: Mapping[str, Any] | None = None
    truth: Sequence[Mapping[str, Any]] | None = None
    networks: Mapping[str, Path] = field(default_factory=dict)


def evaluate(
    dataset: Dataset, asked: Asked, out: Path, *, workers: int = 2, seed: int = 0, report: Report = silent
) -> dict[str, Any]:
    """The ladder on the test sequences; written to `out` (evaluation.json), which is whole or not there.

    Raises RunError where `out` exists or a network is missing, DiagnosisError where no test sequence has clouds.
    """
    out = Path(out)
    if out.exists():
        raise RunError(f"{out} exists already; name another folder or move it away", file=str(out))
    tested = [name for name in dataset.config.test if len(dataset.sequence(name))]
    if not tested:
        raise DiagnosisError("no sequence of [splits] test has clouds, so there is nothing to evaluate on; name one", key="splits")
    report(0.0, "relating robot, camera and phantom")
    registration = register(dataset)
    stated, mended = setup_from(dataset, registration), registration.mended
    data = observe_each(dataset, tested, setup_from(dataset, mended), mended, (TEST_GROUPS, TEST_FELT), part(report, 0.05, 0.2))
    setups = _setups(stated, asked)
    networks = {name: Network.load(folder) for name, folder in asked.networks.items() if name in setups}
    rungs = _rungs(dataset, data, setups, networks, workers, part(report, 0.2, 0.9))
    ends = (0, max(number for number, rung in enumerate(rungs) if rung.network is None))
    kinds = kinds_of_pushes(dataset, data, stated)
    trained = kinds_in(dataset, (*dataset.config.train, *dataset.config.validation), stated)
    found = {"format": 1, "dataset": dataset.name, "split": "test", **ladder(data, rungs, kinds, trained, ends=ends, seed=seed)}
    found["sentence"] = meaning(found)
    _write(out, found)
    report(1.0, "done")
    return found


def _setups(stated: Setup, asked: Asked) -> dict[str, Setup]:
    found = {"baseline": stated}
    if asked.model is not None:
        found["extended"] = kept_setup(stated, asked.model)
    if asked.truth is not None:
        found["true"] = with_effects(stated, effects_from(asked.truth))
    return found


def _rungs(
    dataset: Dataset,
    data: Sequence[Observations],
    setups: Mapping[str, Setup],
    networks: Mapping[str, Network],
    workers: int,
    report: Report,
) -> list[Rung]:
    """Each model, and after it the same with its network."""
    names, found = [item.name for item in data], list[Rung]()
    grid = PAGE_GRID.for_tool(setups["baseline"].tool.radius)  # what networks were trained on, too
    with Workers(data, workers) as pool:
        first: list[Prediction] | None = None
        for number, (name, setup) in enumerate(setups.items()):
            report(number / len(setups), f"replaying the test sequences: {MODELS[name]}")
            # What hangs on the past is led along its own way, and what starts elsewhere may end elsewhere: only points are shared.
            own = [one.result() for one in pool.submit(names, setup, grid, None, first)]
            first = first or own
            found.append(Rung(name=name, label=MODELS[name], setup=setup, predictions=own))
            if name in networks:
                report((number + 0.7) / len(setups), f"correcting them: {MODELS[name]}")
                found.append(_with_network(dataset, data, found[-1], networks[name], grid))
    return found


def _with_network(dataset: Dataset, data: Sequence[Observations], rung: Rung, network: Network, grid: Meshing) -> Rung:
    predictions = []
    for item, model in zip(data, rung.predictions, strict=True):
        columns = network.columns(dataset.sequence(item.name), np.asarray(item.times), rung.setup, grid)
        tool = tools_of(model, item, columns, network.measured)
        predictions.append(corrected_prediction(model, item, rung.setup, network.sampled(rung.setup), network.change, tool))
    label = f"{rung.label} + network"
    return Rung(name=f"{rung.name}_network", label=label, setup=rung.setup, predictions=predictions, network=network.about)


def _write(out: Path, found: dict[str, Any]) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        (aside / FILE).write_text(json.dumps(found, indent=1) + "\n")
        aside.chmod(0o755)
        os.rename(aside, out)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
