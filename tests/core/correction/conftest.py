"""A virtual block with a hidden weight, pushed from above in three sequences, and a stiffer one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from made_datasets import copy_dataset

from palpate.correction import Recorder, Samples, make_samples, recorder_for
from palpate.dataset import Dataset, open_dataset
from palpate.mesh.box_mesh import GridSpec
from palpate.synthetic import HiddenEffect, Scenario

PUSHES = ("poke-top-01", "poke-top-02", "poke-top-03")


@dataclass(frozen=True)
class Bench:
    """A dataset with the recorder and the samples of its stated model."""

    dataset: Dataset
    recorder: Recorder
    samples: Samples


def _bench(folder: Path, weight: float, sequences: tuple[str, ...]) -> Bench:
    hidden = HiddenEffect("gravity", {"specific_weight_over_stiffness": weight})
    scenario = Scenario(
        effects=(hidden,), sequences=sequences, density=900, rate=2.0, robot_rate=200.0, fine=6e-3
    )
    copy_dataset(folder / "block", scenario, seed=7)
    dataset = open_dataset(folder / "block")
    recorder = recorder_for(dataset, grid=GridSpec(nodes=(13, 5, 5)), points=400)
    return Bench(dataset, recorder, make_samples(folder / "samples", recorder))


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return _bench(tmp_path_factory.mktemp("correction"), 2.4, PUSHES)


@pytest.fixture(scope="session")
def stiffer(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """The same block of a material four times as stiff, which sags a quarter as much."""
    return _bench(tmp_path_factory.mktemp("stiffer"), 0.6, PUSHES[:1])
