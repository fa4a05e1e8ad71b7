"""What is asked of a training, and samples on disk that are whole or not."""

from __future__ import annotations

from pathlib import Path

import pytest
from learned_samples import write_samples

from palpate.evaluation.train_network import TrainingPlan, complete_samples
from palpate.foundation.errors import CorrectionError


def test_whole_samples_are_taken_and_what_is_left_of_others_is_removed(tmp_path: Path):
    folder = tmp_path / "samples"
    assert complete_samples(folder) is None
    write_samples(folder, rows=4)
    found = complete_samples(folder)
    assert found is not None and len(found) == 12
    (folder / "two" / "points.npy").unlink()  # as when caches are dropped for want of room
    assert complete_samples(folder) is None and not folder.exists()


def test_request_goes_to_json_and_back():
    wanted = TrainingPlan(spec={"epochs": 3}, nodes=(9, 5, 5), every=2, points=500)
    assert TrainingPlan.from_json(wanted.to_json()) == wanted


@pytest.mark.parametrize(
    ("asked", "said"), [({"every": 0}, "every = 0"), ({"points": 3}, "points = 3")]
)
def test_values_out_of_bounds_are_named(asked: dict[str, int], said: str):
    with pytest.raises(CorrectionError, match=said):
        TrainingPlan(**asked)  # type: ignore[arg-type]
