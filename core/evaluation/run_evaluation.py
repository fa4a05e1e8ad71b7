"""Evaluation of a dataset: models and networks compared on its test sequences."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from palpate.dataset import Dataset
from palpate.dataset.provenance import check_unchanged, made_from
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.observation.force_only import observe_each
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.effects.base import with_effects
from palpate.evaluation.corrected_prediction import corrected_prediction, tool_inputs
from palpate.evaluation.error_ladder import Rung, build_ladder
from palpate.evaluation.loaded_network import LoadedNetwork
from palpate.evaluation.motion_kinds import kinds_in, kinds_of_pushes
from palpate.evaluation.summary_sentence import summary_sentence
from palpate.experiment import Experiment
from palpate.foundation.errors import DiagnosisError, RunError
from palpate.foundation.progress import Report, part, silent
from palpate.mesh.default_meshes import Use
from palpate.mesh.protocol import Meshing
from palpate.recording.saved_model import effects_from, setup_of_model
from palpate.setup.setup import Setup

__all__ = ["FILE", "MODELS", "EvaluationData", "EvaluationSpec", "LadderStep", "evaluate"]

FILE = "evaluation.json"
MODELS = {
    "baseline": "stated model",
    "extended": "extended model",
    "true": "true effects, known to nobody",
}
KINDS = {"unet2d": "2D network", "unet3d": "3D network", "graph": "graph network"}
TEST_GROUPS, TEST_FELT = 24, 32
"""Most groups of a sequence: with clouds, and of the force record."""


@dataclass(frozen=True, kw_only=True)
class EvaluationSpec:
    """The models that are compared with the stated one.

    Attributes:
        model: the extended model, model.json of a diagnosis.
        truth: the true effects of a virtual dataset, as `Effect.to_json` writes them.
        networks: folders of trainings, by the model they were trained on ("baseline", "extended"
            or "true"); further ones on the same model as "baseline:name".
        feedback: see `LoadedNetwork`.
    """

    model: Mapping[str, Any] | None = None
    truth: Sequence[Mapping[str, Any]] | None = None
    networks: Mapping[str, Path] = field(default_factory=dict)
    feedback: Literal["none", "follow"] = "none"


@dataclass(frozen=True, eq=False)
class EvaluationData:
    """The test sequences of a dataset, ready to be compared with models.

    Attributes:
        dataset: the dataset, with sequences as seen from the block where it stood.
        stated: the stated setup.
        data: observations of each test sequence.
        kinds: kind of motion of each push.
        trained: kinds of motion that networks and causes are fitted on.
        grid: mesh protocol of all models, on which networks are trained as well.
    """

    dataset: Dataset
    stated: Setup
    data: Sequence[Observations]
    kinds: Mapping[str, str]
    trained: Collection[str]
    grid: Meshing

    @classmethod
    def read(
        cls, dataset: Dataset, spec: EvaluationSpec | None = None, report: Report = silent
    ) -> EvaluationData:
        """Read the clouds and group them by the clock of the best model in the specification.

        Raises DiagnosisError where no test sequence has clouds.
        """
        tested = [name for name in dataset.config.test if len(dataset.sequence(name))]
        if not tested:
            raise DiagnosisError(
                "no sequence of [splits] test has clouds, so there is nothing to evaluate on; "
                "name one",
                key="splits",
            )
        report(0.0, "registering robot, camera and phantom")
        experiment = Experiment.of(dataset)
        dataset, stated = experiment.dataset, experiment.stated
        *_, believed = _setups(stated, spec or EvaluationSpec()).values()
        setup = experiment.observation_setup(believed.sensor)
        data = observe_each(
            experiment, tested, setup, (TEST_GROUPS, TEST_FELT), part(report, 0.1, 1.0)
        )
        trained = kinds_in(dataset, (*dataset.config.train, *dataset.config.validation), stated)
        kinds = kinds_of_pushes(dataset, data, stated)
        return cls(dataset, stated, data, kinds, trained, experiment.mesh(Use.PAGE, tested))

    def compute_ladder(
        self,
        steps: Sequence[LadderStep],
        *,
        workers: int = 2,
        seed: int = 0,
        report: Report = silent,
    ) -> dict[str, Any]:
        """Return the error ladder of these models.

        The first model is the baseline; networks follow the model that they correct.
        """
        names, rungs = [item.name for item in self.data], list[Rung]()
        with Workers(self.data, workers) as pool:
            first: list[Prediction] | None = None
            for number, step in enumerate(steps):
                report(number / len(steps), f"replaying the test sequences: {step.label}")
                own = [
                    one.result() for one in pool.submit(names, step.setup, self.grid, None, first)
                ]
                first = first or own
                rungs.append(
                    Rung(name=step.name, label=step.label, setup=step.setup, predictions=own)
                )
                rungs += [
                    self._corrected(rungs[-1], name, network)
                    for name, network in step.networks.items()
                ]
        ends = (0, max(number for number, rung in enumerate(rungs) if rung.network is None))
        return build_ladder(self.data, rungs, self.kinds, self.trained, ends=ends, seed=seed)

    def _corrected(self, rung: Rung, name: str, network: LoadedNetwork) -> Rung:
        correct, predictions = network.corrector(rung.setup), []
        for item, model in zip(self.data, rung.predictions, strict=True):
            columns = network.columns(
                self.dataset.sequence(item.name), np.asarray(item.times), rung.setup, self.grid
            )
            predictions.append(
                corrected_prediction(model, item, rung.setup, correct, tool_inputs(item, columns))
            )
        label = f"{rung.label} + {KINDS[network.about['kind']]}"
        return Rung(
            name=name, label=label, setup=rung.setup, predictions=predictions, network=network.about
        )


@dataclass(frozen=True, eq=False)
class LadderStep:
    """A model of the ladder and networks on top of it.

    Attributes:
        name: name of the model's rung.
        label: name for readers.
        setup: the setup of the model.
        networks: networks by the names of their rungs.
    """

    name: str
    label: str
    setup: Setup
    networks: Mapping[str, LoadedNetwork] = field(default_factory=dict)


def evaluate(
    dataset: Dataset,
    spec: EvaluationSpec,
    out: Path,
    *,
    workers: int = 2,
    seed: int = 0,
    report: Report = silent,
) -> dict[str, Any]:
    """Compare models on the test sequences; return the ladder, and write it to `out` atomically.

    Args:
        dataset: the dataset.
        spec: the models that are compared.
        out: folder of the result, which has evaluation.json.
        workers: number of processes.
        seed: seed of the resampling.
        report: receives the progress.

    Raises RunError where `out` exists or a network is missing, DiagnosisError where no test
    sequence has clouds.
    """
    out = Path(out)
    if out.exists():
        raise RunError(f"{out} exists already; name another folder or move it away", file=str(out))
    networks = {
        name: LoadedNetwork.load(folder, spec.feedback) for name, folder in spec.networks.items()
    }
    made = made_from(dataset.path)
    data = EvaluationData.read(dataset, spec, part(report, 0.0, 0.2))
    steps = [
        LadderStep(name, MODELS[name], setup, _own(name, networks))
        for name, setup in _setups(data.stated, spec).items()
    ]
    ladder = data.compute_ladder(steps, workers=workers, seed=seed, report=part(report, 0.2, 0.95))
    result = {
        "format": 1,
        "dataset": dataset.name,
        "folder": dataset.path.resolve().name,
        "split": "test",
        **ladder,
        "made_from": {**made, "seed": seed},
    }
    check_unchanged(dataset.path, made)
    result["sentence"] = summary_sentence(result)
    _write(out, result)
    report(1.0, "done")
    return result


def _own(model: str, networks: Mapping[str, LoadedNetwork]) -> dict[str, LoadedNetwork]:
    """Return the networks of one model by the names of their rungs.

    The first is called "network", others by their kind.
    """
    rungs: dict[str, LoadedNetwork] = {}
    for key, network in networks.items():
        if key.partition(":")[0] == model:
            rung = f"{model}_network" if not rungs else f"{model}_{network.about['kind']}"
            rungs[rung if rung not in rungs else f"{model}_{key.partition(':')[2]}"] = network
    return rungs


def _setups(stated: Setup, spec: EvaluationSpec) -> dict[str, Setup]:
    setups = {"baseline": stated}
    if spec.model is not None:
        setups["extended"] = setup_of_model(stated, spec.model)
    if spec.truth is not None:
        setups["true"] = with_effects(stated, effects_from(spec.truth))
    return setups


def _write(out: Path, result: dict[str, Any]) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        (aside / FILE).write_text(json.dumps(result, indent=1) + "\n")
        aside.chmod(0o755)
        os.rename(aside, out)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
