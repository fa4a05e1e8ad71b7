"""Depth images of each coding become the dataset that the points themselves become."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bench_recording import BenchRecording, SeenAs, bench_setup
from recorded_bags import BagKind

from palpate.dataset import Dataset, open_dataset
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import import_recordings
from palpate.importing.rules import WrenchRules
from palpate.importing.survey import survey

STEP = 0.5e-3
"""Half the step of depths that are stored in whole millimetres [m]."""


def imported(folder: Path, seen_as: SeenAs) -> Dataset:
    kind: BagKind = "mcap" if seen_as == "compressed" else "ros1"
    bag = BenchRecording().write(
        folder / ("bench" if kind == "mcap" else "bench.bag"), kind, seen_as=seen_as
    )
    notes = ImportNotes()
    found = survey([bag], bench_setup(folder))
    mapping = found.proposal("bench", notes)
    found.close()
    rules = WrenchRules(frame="tool", zero="fitted", weight="fitted")
    import_recordings(
        mapping.model_copy(update={"wrench": rules}), Path.cwd(), folder / "made", notes
    )
    return open_dataset(folder / "made")


@pytest.fixture(scope="module")
def of_points(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return imported(tmp_path_factory.mktemp("points"), "points")


@pytest.mark.parametrize(
    ("seen_as", "bound"), [("32FC1", 1e-6), ("16UC1", STEP * 1.05), ("compressed", STEP * 1.05)]
)
def test_depth_images_give_the_dataset_of_the_points(
    tmp_path: Path, of_points: Dataset, seen_as: SeenAs, bound: float
) -> None:
    dataset = imported(tmp_path, seen_as)
    assert dataset.sequences == of_points.sequences
    for name in dataset.sequences:
        one, other = dataset.sequence(name), of_points.sequence(name)
        np.testing.assert_array_equal(one.kinematics.position, other.kinematics.position)
        np.testing.assert_array_equal(one.cloud_times, other.cloud_times)
        for at in range(len(one)):
            np.testing.assert_allclose(one.cloud(at), other.cloud(at), atol=bound)
    np.testing.assert_allclose(dataset.rest_cloud(), of_points.rest_cloud(), atol=bound)
