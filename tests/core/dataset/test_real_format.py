"""The datasets of another solver, where they are at hand: PALPATE_DATASETS, or shared/datasets
beside the repository.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import open_dataset
from palpate.dataset.check import check_dataset
from palpate.foundation.frames import Transform

HOME = Path(os.environ.get("PALPATE_DATASETS", Path(__file__).parents[4] / "shared" / "datasets"))
FOLDERS = sorted(path.parent for path in HOME.glob("*/dataset.toml"))

pytestmark = pytest.mark.skipif(
    not FOLDERS, reason=f"no datasets in {HOME}; set PALPATE_DATASETS to a folder of them"
)


def true_phantom_from_robot(folder: Path) -> Transform:
    truth = json.loads(folder.with_suffix(".truth.json").read_text())["registration"]
    return Transform(
        np.array(truth["robot_from_phantom_R"]), np.array(truth["robot_from_phantom_t"])
    ).inverse()


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_every_dataset_opens_and_all_its_clouds_can_be_read(folder: Path) -> None:
    dataset = open_dataset(folder)
    dataset.validate()
    assert len(dataset.sequences) >= 3
    assert set(dataset.config.train) <= set(dataset.sequences)
    assert len(dataset.rest_cloud()) > 1000


@pytest.mark.parametrize(
    "folder",
    [folder for folder in FOLDERS if folder.with_suffix(".truth.json").exists()],
    ids=lambda folder: folder.name,
)
def test_motions_are_what_the_names_of_the_sequences_say(folder: Path) -> None:
    summary = check_dataset(open_dataset(folder), true_phantom_from_robot(folder))
    for sequence in summary.sequences:
        assert sequence.motion is not None
        kinds = {contact.kind for contact in sequence.motion.contacts}
        expected = next(kind for kind in ("drag", "side", "top") if kind in sequence.name)
        assert kinds == {expected}, sequence.name
    assert summary.warnings == ()
