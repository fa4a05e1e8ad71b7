"""The plan of a training, and complete and incomplete samples on disk."""

from __future__ import annotations

from pathlib import Path

import pytest
from learned_samples import write_samples

from palpate.evaluation.train_network import TrainingPlan, complete_samples
from palpate.foundation.errors import CorrectionError


def test_complete_samples_are_used_and_incomplete_ones_removed(tmp_path: Path):
    folder = tmp_path / "samples"
    assert complete_samples(folder) is None
    write_samples(folder, rows=4)
    samples = complete_samples(folder)
    assert samples is not None and len(samples) == 12
    (folder / "two" / "points.npy").unlink()  # as when a full cache is emptied
    assert complete_samples(folder) is None and not folder.exists()


def test_plan_survives_json():
    plan = TrainingPlan(spec={"epochs": 3}, nodes=(9, 5, 5), every=2, points=500)
    assert TrainingPlan.from_json(plan.to_json()) == plan


@pytest.mark.parametrize(
    ("values", "message"), [({"every": 0}, "every = 0"), ({"points": 3}, "points = 3")]
)
def test_values_out_of_bounds_are_named(values: dict[str, int], message: str):
    with pytest.raises(CorrectionError, match=message):
        TrainingPlan(**values)  # type: ignore[arg-type]
