from __future__ import annotations

from pathlib import Path

from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.evaluation.run_evaluation import EvaluationData, EvaluationSpec


def test_frames_are_grouped_by_the_clock_of_the_best_model(tmp_path: Path):
    dataset = open_dataset(write_valid_dataset(tmp_path / "block"))
    late = EvaluationSpec(truth=[{"effect": "time_offset", "parameters": {"offset": 0.3}}])
    stated, best = (EvaluationData.read(dataset, spec).data[0].groups for spec in (None, late))
    # The tool is near the block from 0.3 to 0.7 s, and clouds are taken every 0.2 s from 0.1 s on.
    assert [(group.frames, group.free) for group in stated[1:]] == [
        ((0,), True),
        ((1,), False),
        ((2,), False),
        ((3,), False),
        ((4,), True),
    ]
    assert [(group.frames, group.free) for group in best[1:]] == [
        ((0, 1, 2), True),
        ((3, 4), False),
    ]
