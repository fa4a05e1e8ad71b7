"""Palpation by force alone as the bench makes it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import open_dataset
from palpate.registration.registration import register, setup_from
from palpate.setup.setup import Shape
from palpate.synthetic import draw_palpation, make_palpation, truth_path
from palpate.synthetic.bodies.organ_shape import organ_surface
from palpate.synthetic.make_palpation import _motions

SPLITS = {"train": 1, "validation": 0, "test": 0}


@pytest.mark.parametrize("body", ["box", "organ"])
def test_tool_touches_only_where_it_presses(body: str) -> None:
    palpation = draw_palpation("box" if body == "box" else "organ", 0, seed=1)
    radius = palpation.scenario.tool_radius
    shape = Shape(*organ_surface())
    for motion in _motions(palpation, 1)[:2]:
        times = np.arange(0, motion.duration, 0.02)
        centres = motion.centre(times)
        if body == "box":
            depth = palpation.scenario.size[2] + radius - centres[:, 2]
        else:
            depth = radius - shape.facing(centres)[0]
        touching = np.concatenate([[False], depth > 0, [False]])
        assert (np.diff(touching.astype(int)) == 1).sum() == palpation.pushes
        assert 2e-3 < depth.max() < 6e-3
        assert not touching[1 : 1 + round(1.5 / 0.02)].any()  # the sensor's bias shows first


@pytest.mark.parametrize("body", ["box", "organ"])
def test_lump_lies_within_the_body(body: str) -> None:
    for seed in range(4):
        palpation = draw_palpation("box" if body == "box" else "organ", 1, seed)
        lump = palpation.scenario.effects[0]
        centre = np.array([[lump.value(axis) for axis in "xyz"]])
        depth = (
            palpation.scenario.size[2] - centre[0, 2]
            if body == "box"
            else -Shape(*organ_surface()).facing(centre)[0][0]
        )
        assert lump.value("radius") + 1e-3 < depth < 0.016


def test_dataset_of_a_box_reads_back_with_forces_alone(tmp_path: Path) -> None:
    drawn = draw_palpation("box", 1, seed=2)
    scenario = replace(drawn.scenario, fine=6e-3)
    make_palpation(
        tmp_path / "felt", replace(drawn, scenario=scenario, pushes=1, splits=(1, 0, 0)), seed=2
    )
    dataset = open_dataset(tmp_path / "felt")
    assert dataset.config.train == ("palpation-01",) and not dataset.observed
    sequence = dataset.sequence("palpation-01")
    assert sequence.forces is not None and len(sequence) == 0
    setup = setup_from(dataset, register(dataset))
    path = setup.phantom_from_robot.apply(sequence.kinematics.position)
    depth = setup.geometry.height + setup.tool.radius - path[:, 2]
    force = np.linalg.norm(sequence.forces.force - sequence.forces.force[:200].mean(axis=0), axis=1)
    assert 3e-3 < depth.max() < 6e-3 and force.max() > 0.05
    truth = json.loads(truth_path(tmp_path / "felt").read_text())
    assert truth["verdict"] == "found" and truth["effects"][0]["effect"] == "stiff_inclusion"
