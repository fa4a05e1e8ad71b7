"""Palpation with forces and no clouds, from folder to report.

An inclusion is found below the pushes, its footprint is drawn, and the modulus is identified.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpated import write_palpation

from palpate.dataset import open_dataset
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.gain.force_gain import force_gain
from palpate.diagnosis.observation.force_record import ForceComparison
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.diagnosis.pipeline import diagnose
from palpate.diagnosis.report.inclusion_footprint import outline
from palpate.diagnosis.report.palpation_figure import section
from palpate.diagnosis.validation.force_controls import exchanged
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError
from palpate.mesh.graded_mesh import Grading
from palpate.replay.replay import Replay
from palpate.setup.setup import Box, Inclusion, Material, Setup, Shape, Tool
from palpate.synthetic.bodies.organ_shape import organ_surface

SIZE = (0.06, 0.04, 0.03)
LUMP = Inclusion(x=0.006, y=-0.003, z=0.0185, radius=7e-3, stiffness_ratio=6.0)
TRUTH = Grading(spacing=1.1e-3, along=0.6, inward=0.9, longest=0.3)
E = 5.6e3


def _felt_dataset(root: Path, lumps: tuple[Inclusion, ...]) -> Path:
    true = Setup(
        geometry=Box(size=SIZE),
        tool=Tool(radius=5e-3),
        material=Material(young_modulus=E, inclusions=lumps),
    )
    random, up = np.random.default_rng(0), np.array([0.0, 0.0, 1.0])
    places = {
        f"felt-{number}": [
            (np.array([x + random.uniform(-2e-3, 2e-3), y, SIZE[2]]), up)
            for x, y in zip(
                (-0.015, -0.002, 0.006, 0.018),
                random.permutation([-8e-3, -3e-3, 2e-3, 8e-3]),
                strict=True,
            )
        ]
        for number in range(5)
    }
    splits = {
        "train": ["felt-0", "felt-1", "felt-2"],
        "validation": [],
        "test": ["felt-3", "felt-4"],
    }
    return write_palpation(
        root, true, TRUTH, places, splits, f'geometry = "box"\nsize = {list(SIZE)}'
    )


@pytest.mark.slow
def test_inclusion_is_found_with_place_depth_and_footprint(tmp_path: Path) -> None:
    root = tmp_path / "felt"
    root.mkdir()
    report = diagnose(open_dataset(_felt_dataset(root, (LUMP,))), tmp_path / "run", workers=1)
    (cause,) = report["causes"]
    found = {name: entry["value"] for name, entry in cause["parameters"].items()}
    assert report["verdict"] == "found" and cause["effect"] == "stiff_inclusion"
    assert np.hypot(found["x"] - LUMP.x, found["y"] - LUMP.y) < 2e-3
    assert cause["depth"]["low"] < SIZE[2] - LUMP.z < cause["depth"]["high"]
    assert cause["cover"]["value"] == pytest.approx(
        cause["depth"]["value"] - found["radius"], abs=1e-6
    )
    contour = np.array(cause["footprint"]["contour"])
    assert contour.shape == (CRITERIA.footprint.directions, 3) and contour[:, 2] == pytest.approx(
        SIZE[2]
    )
    assert np.linalg.norm(contour[:, :2].mean(axis=0) - (LUMP.x, LUMP.y)) < 3e-3
    told = report["palpation"]["young_modulus"]
    assert told["low"] < E < told["high"] and not report["not_identifiable"]
    assert report["gain"]["unit"] == "mN" and report["gain"]["reducible_removed"]["low"] > 0.5
    assert len(report["palpation"]["felt"]) == report["palpation"]["pushes"] == 12
    assert [one["control"] for one in report["controls"]] == ["pushes exchanged"] and report[
        "controls"
    ][0]["passed"]
    assert (tmp_path / "run" / "pictures" / "palpation.png").stat().st_size > 20_000
    model = json.loads((tmp_path / "run" / "model.json").read_text())
    assert model["criteria"] == report["criteria"] == {"version": CRITERIA.version}


def test_outline_is_where_the_change_falls_to_the_level() -> None:
    change = np.tile(np.array([0.7, 0.3, 0.0, 0.0])[:, None], CRITERIA.footprint.directions)
    change[2, 0] = change[3, 0] = 0.9  # one way on which it never falls
    found = outline(1.0, change, CRITERIA.footprint.level)
    halfway = CRITERIA.footprint.rings[0] + (0.7 - CRITERIA.footprint.level) / (0.7 - 0.3) * (
        CRITERIA.footprint.rings[1] - CRITERIA.footprint.rings[0]
    )
    assert found[1:] == pytest.approx(halfway) and found[0] == CRITERIA.footprint.rings[-1]
    assert outline(
        0.1,
        np.zeros((len(CRITERIA.footprint.rings), CRITERIA.footprint.directions)),
        CRITERIA.footprint.level,
    ) == pytest.approx(CRITERIA.footprint.rings[0] / 2)


def test_cut_through_a_body_is_its_outline() -> None:
    box = section(Box(size=SIZE), 1, 1e-4)
    assert box[..., 1].max() == pytest.approx(SIZE[2])
    assert np.abs(box[..., 0]).max() == pytest.approx(SIZE[0] / 2)
    for cut in (box, section(Shape(*organ_surface()), 0, 1e-4)):
        ends = np.unique(np.round(cut.reshape(-1, 2), 7), axis=0, return_counts=True)[1]
        assert (ends == 2).all()  # a closed line


def test_exchanged_shares_follow_the_other_pushes_forces() -> None:
    force, push = (
        np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]]),
        np.array([1, 1, 2, 2]),
    )
    pattern = 0.1 * force
    pattern[2:] = 0.0
    found = exchanged(pattern, force, push)
    assert found[:2] == pytest.approx(0.0) and found[2:] == pytest.approx(0.1 * force[2:])


def _prediction(gap: FloatArray) -> Prediction:
    block = Replay(
        Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3)), Grading(spacing=8e-3), 1e-3
    )
    forces = ForceComparison(
        gap,
        np.full(len(gap), 1e-3),
        np.ones((len(gap), 3)),
        np.zeros((len(gap), 3, 0)),
        np.array([1, 1, 2, 2]),
    )
    nothing = np.zeros((len(gap), 0))
    return Prediction(
        "felt",
        nothing,
        nothing,
        nothing,
        np.zeros((len(gap), 0, 0)),
        (block.free,) * len(gap),
        (),
        forces,
    )


def test_gain_is_the_share_of_the_error_above_the_sensor_noise() -> None:
    groups = tuple(Group((n,), np.empty((0, 3)), False, push=1 + n // 2) for n in range(4))
    item = Observations("felt", np.arange(4.0), None, groups, force_only=True)  # type: ignore[arg-type]
    before = _prediction(np.tile([0.0, 0.0, 10e-3], (4, 1)))
    after = _prediction(np.tile([0.0, 0.0, 4e-3], (4, 1)))
    found = force_gain([item], [before], [after], 0)
    floor = np.sqrt(3) * 1e-3
    assert (found.baseline, found.extended, found.noise_floor) == pytest.approx(
        (10e-3, 4e-3, floor)
    )
    assert found.removed == pytest.approx([6e-3 / (10e-3 - floor)] * 3) and found.probes == 2
    assert found.to_json("test")["unit"] == "mN" and found.to_json("test")["baseline"] == 10.0
    with pytest.raises(DiagnosisError, match="no push whose force is known"):
        force_gain([item], [_prediction(np.full((4, 3), np.nan))], [after], 0)


def test_test_sequences_without_clouds_beside_fitted_ones_with_are_refused(
    tmp_path: Path, monkeypatch: Any
) -> None:
    root = tmp_path / "felt"
    root.mkdir()
    _sparse(root)
    dataset = open_dataset(root)
    with pytest.raises(DiagnosisError, match="at least 2 are needed"):
        diagnose(dataset, tmp_path / "run")


def _sparse(root: Path) -> None:
    true = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
    push = [(np.array([0.0, 0.0, SIZE[2]]), np.array([0.0, 0.0, 1.0]))]
    splits = {"train": ["felt-0"], "validation": [], "test": []}
    write_palpation(
        root,
        true,
        Grading(spacing=4e-3),
        {"felt-0": push},
        splits,
        f'geometry = "box"\nsize = {list(SIZE)}',
    )
