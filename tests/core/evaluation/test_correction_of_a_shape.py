"""A correction network on a phantom that is no block: trained, evaluated, recorded for the page.

The phantom is a small dome, and the tool is larger than stated.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pressed_dome import write_pressed_dome

from palpate.correction import SurfaceLoss, TrainedNetwork, body_for, sample_errors
from palpate.dataset import Dataset
from palpate.evaluation.loaded_network import LoadedNetwork
from palpate.evaluation.record_corrections import record_corrections
from palpate.evaluation.run_evaluation import EvaluationSpec, evaluate
from palpate.evaluation.train_network import TrainingPlan, complete_samples, train_network
from palpate.recording.replay_run import replay_into

pytestmark = pytest.mark.more
TRAINED, STOPPING, TESTED = ("poke-top-01", "poke-top-04"), "poke-top-02", "poke-top-03"
PLAN = TrainingPlan(
    spec={
        "network": {"kind": "unet3d", "features": [8, 16]},
        "epochs": 30,
        "patience": 30,
        "batch": 8,
        "rate": 3e-3,
        "hold": 1.0,
        "device": "cpu",
    },
    nodes=(9, 7, 5),
    points=600,
)


@dataclass(frozen=True)
class Trained:
    """A dataset of a dome and a network that was trained on it."""

    home: Path
    dataset: Dataset
    training: Path
    summary: dict[str, Any]


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    home = tmp_path_factory.mktemp("dome")
    splits = {"train": TRAINED, "validation": (STOPPING,), "test": (TESTED,)}
    dataset = write_pressed_dome(home / "dome", splits)
    training = home / "training"
    summary = train_network(dataset, PLAN, training, store=home / "samples", workers=1)
    return Trained(home, dataset, training, summary)


def test_network_lowers_the_error_on_frames_of_the_held_out_sequence(trained: Trained) -> None:
    summary = trained.summary
    assert summary["validation_error_mm"] < 0.97 * summary["validation_error_without_mm"]
    network = TrainedNetwork.load(trained.training)
    (folder,) = (trained.home / "samples").iterdir()
    samples = complete_samples(folder)
    assert samples is not None and samples.body.count == 9 * 7 * 5 < len(samples.body.rest)
    body = body_for(samples, "unet3d")
    loss = SurfaceLoss(body, samples.seen[body.nodes])
    rows = samples.rows([STOPPING])
    before, after = (
        sample_errors(net, loss, body, samples, rows) for net in (None, network.network)
    )
    pushed = np.linalg.norm(samples.column("tool", rows)[:, 10:], axis=1) > 0.05
    assert pushed.sum() > 5
    # Half of a distance is that of a point to the nearest vertex along the surface.
    assert after[pushed].mean() < 0.97 * before[pushed].mean()
    assert (after[pushed] < before[pushed]).all()


@pytest.mark.parametrize("feedback", ["none", "follow"])
def test_error_ladder_has_the_network_nearer_on_pushes_that_nothing_was_fitted_on(
    trained: Trained, feedback: Any
) -> None:
    spec = EvaluationSpec(networks={"baseline": trained.training}, feedback=feedback)
    found = evaluate(trained.dataset, spec, trained.home / f"ladder-{feedback}", workers=1)
    assert [rung["name"] for rung in found["rungs"]] == ["baseline", "baseline_network"]
    errors = next(one for one in found["parts"] if one["part"] == "all")["errors"]
    assert errors["baseline_network"]["error"] < errors["baseline"]["error"]
    assert errors["baseline_network"]["moving"]["error"] < errors["baseline"]["moving"]["error"]
    assert "network alone removes" in found["sentence"]


def test_corrected_surface_stands_beside_that_of_the_run(trained: Trained) -> None:
    run = trained.home / "run"
    run.mkdir()
    replay_into(trained.dataset, run, [TESTED], [], workers=1)
    with np.load(run / "replays" / f"{TESTED}.npz") as arrays:
        shown = dict(arrays)
    record_corrections(
        trained.dataset,
        json.loads((run / "model.json").read_text()),
        LoadedNetwork.load(trained.training),
        {TESTED: shown["cloud_index"]},
        trained.home / "corrections",
    )
    with np.load(trained.home / "corrections" / f"{TESTED}.npz") as arrays:
        shown = {**shown, **arrays}
    assert shown["corrected"].shape == shown["raw"].shape
    deep = np.linalg.norm(shown["raw"] - shown["rest"], axis=2).max(axis=1) > 2e-3
    assert deep.sum() > 5
    moved = np.linalg.norm(shown["corrected"] - shown["raw"], axis=2).max(axis=1)
    assert (moved[deep] > 2e-4).all()
    assert shown["distance_corrected"][deep].mean() < 0.85 * shown["distance_raw"][deep].mean()
