"""Kinds of motion of sequences and of pushes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.evaluation.motion_kinds import kinds_in, kinds_of_pushes
from palpate.registration.registration import register, setup_from
from palpate.setup.setup import Setup


def _dragged(folder: Path, setup: Setup) -> None:
    """Let the tool of a sequence travel 15 mm along the top at a depth of 3 mm."""
    file = folder / "kinematics.csv"
    header, *rows = file.read_text().splitlines()
    back = setup.phantom_from_robot.inverse()
    moved = []
    for row, share in zip(rows, np.linspace(0, 1, len(rows)), strict=True):
        time, _, _, _, *turn = row.split(",")
        deep = 3e-3 if 0.2 < share < 0.8 else -20e-3
        place = back.apply(
            np.array(
                [
                    [
                        0.015 * (share - 0.5) / 0.6,
                        0.002,
                        setup.geometry.height + setup.tool.radius - deep,
                    ]
                ]
            )
        )[0]
        moved.append(",".join([time, *(f"{value:.7f}" for value in place), *turn]))
    file.write_text("\n".join([header, *moved]) + "\n")


def test_pushes_and_drags_are_distinguished(tmp_path: Path):
    folder = write_valid_dataset(tmp_path / "block")
    dataset = open_dataset(folder)
    setup = setup_from(dataset, register(dataset))
    _dragged(folder / "sequences" / "drag-01", setup)
    dataset = open_dataset(folder)
    assert kinds_in(dataset, ["poke-01"], setup) == {"top"}
    assert kinds_in(dataset, dataset.sequences, setup) == {"top", "drag"}
    data = []
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        groups = (
            Group((0,), np.zeros((0, 3)), True),
            Group((2, 3), np.zeros((0, 3)), False, push=1),
        )
        data.append(
            Observations(name, np.asarray(sequence.cloud_times), sequence.kinematics, groups)
        )
    assert kinds_of_pushes(dataset, data, setup) == {"poke-01/1": "top", "drag-01/1": "drag"}
