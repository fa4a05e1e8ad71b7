"""Several statements about the robot: one leads, the others check it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shapes import box_surface, write_felt_shape

from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError, RegistrationError
from palpate.registration.registration import register

SIZE = (0.06, 0.04, 0.03)
RADIUS = 5e-3


def _with_matrix(root: Path, shift: tuple[float, float, float], sigmas: str = "") -> None:
    x, y, z = shift
    rows = f"[[1, 0, 0, {x}], [0, 1, 0, {y}], [0, 0, 1, {z}], [0, 0, 0, 1]]"
    path = root / "dataset.toml"
    text = path.read_text().replace(
        "[splits]", f"[robot]\nphantom_from_robot = {rows}\n{sigmas}\n[splits]"
    )
    path.write_text(text)


def _write_traces(root: Path, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    """Write places of the ball on top and two sides of the block, every eighth one lifted."""
    random = np.random.default_rng(0)
    u, v = random.uniform(-0.8, 0.8, (2, 20))
    half_x, half_y, top = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
    height = 0.5 * top * (1.1 + 0.7 * v)
    places = [
        np.column_stack([half_x * u, half_y * v, np.full(20, top + RADIUS)]),
        np.column_stack([np.full(20, half_x + RADIUS), half_y * u, height]),
        np.column_stack([half_x * u, np.full(20, -half_y - RADIUS), height]),
    ]
    normals = np.repeat(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), 20, axis=0)
    centres = np.concatenate(places) + random.normal(size=(60, 3)) * 1e-4 + shift
    centres[::8] += 6e-3 * normals[::8]
    rows = [f"{n // 5},{0.1 * n:.1f},{x},{y},{z}" for n, (x, y, z) in enumerate(centres.tolist())]
    (root / "traces.csv").write_text("\n".join(["stroke,t,x,y,z", *rows]) + "\n")


def test_matrix_alone_relates_robot_and_phantom(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    (root / "touches.csv").unlink()
    with pytest.raises(DatasetError, match=r"touches.csv: not found"):
        open_dataset(root)
    _with_matrix(root, (1e-3, 0, 0), "position_sigma = 5e-4\nrotation_sigma = 2e-3")
    found = register(open_dataset(root))
    assert found.phantom_from_robot.translation == pytest.approx([1e-3, 0.0, 0.0])
    assert found.robot is not None and "within 0.5 mm and 0.11 degrees" in found.robot.summary
    # The robot's origin is near the phantom here, so that turns about it move it little.
    spread = np.sqrt(np.diag(found.robot_covariance))
    assert spread[:3] == pytest.approx(5e-4, rel=0.02) and spread[3:] == pytest.approx(2e-3)
    assert not found.warnings


@pytest.mark.parametrize(("shift", "told"), [(0.5e-3, False), (8e-3, True)])
def test_matrix_that_contradicts_the_touches_is_told(
    tmp_path: Path, shift: float, told: bool
) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    _with_matrix(root, (0, shift, 0))
    found = register(open_dataset(root))
    assert np.linalg.norm(found.phantom_from_robot.translation) < 1e-6
    sentence = (
        "[robot] phantom_from_robot puts the robot 8.0 mm from where touches.csv puts it, mainly "
        "along y, and turned by 0.0 degrees"
    )
    assert any(sentence in text for text in found.warnings) == told
    assert bool(found.warnings) == told


def test_traces_alone_relate_robot_and_phantom_from_a_rough_matrix(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    (root / "touches.csv").unlink()
    _write_traces(root, (3e-3, 0.0, 0.0))
    _with_matrix(root, (0, 0, 0), "position_sigma = 4e-3\nrotation_sigma = 0.05")
    found = register(open_dataset(root))
    assert found.phantom_from_robot.translation == pytest.approx([-3e-3, 0.0, 0.0], abs=2e-4)
    assert found.robot is not None and found.robot.source == "traces.csv"
    assert "52 of 60 traced points lie on the surface" in found.robot.summary
    assert "8 are lifts" in found.robot.summary
    assert not found.warnings


def test_traces_check_the_touches(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    _write_traces(root, (0.0, 0.0, 2e-3))
    found = register(open_dataset(root))
    assert np.linalg.norm(found.phantom_from_robot.translation) < 1e-6
    (warning,) = found.warnings
    assert "traces.csv puts the robot 2." in warning and "mainly along z" in warning


def test_hand_eye_calibration_needs_clouds(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    (root / "touches.csv").unlink()
    rows = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]]"
    path = root / "dataset.toml"
    camera = f'[camera]\nname = "c"\ndepth_sigma = 0.001\nrobot_from_camera = {rows}\n'
    path.write_text(path.read_text().replace("[splits]", f"{camera}[splits]"))
    with pytest.raises(RegistrationError, match=r"nothing relates the robot .* needs clouds"):
        register(open_dataset(root))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (["1,0.0,0.1,0.0,0.0"] * 5, r"traces.csv, row 7: 5 points; expected at least 12"),
        (["1,0.0,0.1,0.0,0.0"] * 12 + ["1,0.0,x,0,0"], r"traces.csv, row 14: x = 'x'"),
        (["1,0.0,100.0,0.0,0.0"] * 12, r"traces.csv, row 2: x = 100 m; expected metres"),
    ],
)
def test_wrong_traces_are_refused_in_words(tmp_path: Path, rows: list[str], words: str) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    (root / "traces.csv").write_text("\n".join(["stroke,t,x,y,z", *rows]) + "\n")
    with pytest.raises(DatasetError, match=words):
        open_dataset(root)
