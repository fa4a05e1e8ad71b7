"""What lies outside the catalogue: its size, and that the files show it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.dataset import open_dataset
from core.errors import EffectError
from core.frames import FloatArray, Transform
from core.synthetic import DISTURBANCES, Disturbance, Scenario, draw_disturbance, make_dataset, truth_path
from core.synthetic.disturbance import drifted, rippled

DRIFT = Disturbance("camera_drift", {"translation": 1.5e-3, "rotation": 0.02})
RIPPLE = Disturbance("depth_ripple", {"amplitude": 2e-3, "period": 20e-3})


def _drift(share: float, disturbances: tuple[Disturbance, ...] = (DRIFT,)) -> Transform:
    return drifted(disturbances, share, np.random.default_rng(4))


def test_camera_is_right_half_way_and_off_either_way_at_the_ends() -> None:
    assert np.allclose(_drift(0.5).matrix, np.eye(4))
    for share in (0.0, 1.0):
        assert np.linalg.norm(_drift(share).translation) == pytest.approx(1.5e-3)
        assert Rotation.from_matrix(_drift(share).rotation).magnitude() == pytest.approx(0.02)
    assert _drift(0.0).translation == pytest.approx(-_drift(1.0).translation)


def test_depth_ripples_about_the_truth() -> None:
    depth = np.linspace(0.3, 0.4, 2001)
    off = rippled([RIPPLE], depth) / depth - 1.0
    assert np.abs(off).max() == pytest.approx(2e-3, rel=1e-3)
    assert abs(off.mean()) < 1e-5
    assert np.allclose(rippled([RIPPLE], depth + 20e-3) / (depth + 20e-3) - 1.0, off)


def test_no_disturbance_disturbs_nothing() -> None:
    depth = np.linspace(0.3, 0.4, 11)
    assert np.array_equal(rippled([], depth), depth) and np.array_equal(rippled([DRIFT], depth), depth)
    assert np.array_equal(_drift(0.0, ()).matrix, np.eye(4)) and np.array_equal(_drift(0.0, (RIPPLE,)).matrix, np.eye(4))


@pytest.mark.parametrize("name", DISTURBANCES)
def test_drawn_ones_are_clear_and_repeat_themselves(name: str) -> None:
    drawn = draw_disturbance(name, 5)
    assert drawn.name == name and drawn == draw_disturbance(name, 5) != draw_disturbance(name, 6)
    assert all(value > 0 for value in drawn.parameters.values())


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("moon", {}, "cannot disturb by 'moon'; it knows camera_drift, depth_ripple"),
        ("depth_ripple", {"period": 0.1}, "needs the parameters"),
    ],
)
def test_unknown_ones_and_missing_numbers_are_told(name: str, parameters: dict[str, float], words: str) -> None:
    with pytest.raises(EffectError, match=words):
        Disturbance(name, parameters)
    with pytest.raises(EffectError, match="cannot disturb by 'moon'"):
        draw_disturbance("moon", 0)


def _table(pose: Transform, cloud: FloatArray) -> FloatArray:
    """Height over the table (n,) [m] of the points far from the block, taken to be where the camera was registered."""
    points = pose.apply(cloud)
    return np.asarray(points[(np.abs(points[:, 2]) < 6e-3) & (np.linalg.norm(points[:, :2], axis=1) > 0.05), 2])


@pytest.mark.parametrize("one", [DRIFT, RIPPLE], ids=lambda one: one.name)
def test_files_show_it_and_the_truth_says_unexplained(one: Disturbance, tmp_path: Path) -> None:
    quick = {"sequences": ("poke-top-01",), "fine": 4.5e-3, "density": 900, "rate": 1.0, "robot_rate": 200.0}
    spread = {}
    for name, disturbances in (("plain", ()), ("disturbed", (one,))):
        truth = make_dataset(tmp_path / name, Scenario(disturbances=disturbances, **quick), seed=3)  # type: ignore[arg-type]
        dataset = open_dataset(tmp_path / name)
        first = dataset.sequence("poke-top-01").cloud(0)
        spread[name] = [float(np.std(_table(truth.phantom_from_camera, cloud))) for cloud in (dataset.rest_cloud(), first)]
    saved = json.loads(truth_path(tmp_path / "disturbed").read_text())
    assert (saved["verdict"], saved["effects"]) == ("unexplained", [])
    assert saved["disturbances"][0]["effect"] == one.name
    assert "disturbances" not in json.loads(truth_path(tmp_path / "plain").read_text())
    rest, begun = (after / before for before, after in zip(spread["plain"], spread["disturbed"], strict=True))
    assert begun > 1.1
    assert rest > 1.1 if one is RIPPLE else rest == pytest.approx(1.0)
