"""Angles, rotation vectors and quaternions without named components give the same poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.table_source import TableSource

TURNS = Rotation.from_euler("xyz", np.linspace([2.9, -0.2, 0.1], [3.4, 0.3, 0.9], 30))
PLACES = np.linspace([0.1, 0.0, 0.2], [0.12, 0.01, 0.15], 30)


def written(path: Path, header: str, *columns: np.ndarray) -> Path:
    rows = np.column_stack([np.arange(30) * 0.01, PLACES, *columns])
    lines = [",".join(f"{value:.9f}" for value in row) for row in rows.tolist()]
    path.write_text("\n".join([f"t,x,y,z,{header}", *lines]) + "\n")
    return path


def turns_of(source: TableSource) -> Rotation:
    name = next(one.name for one in source.streams() if one.kind == "pose")
    return Rotation.from_quat([one.value()[3:] for one in source.samples({name})])


def assert_same(found: Rotation) -> None:
    assert (found.inv() * TURNS).magnitude().max() < 1e-6


@pytest.mark.parametrize(
    ("header", "values"),
    [
        ("roll,pitch,yaw", TURNS.as_euler("xyz")),
        ("Roll (deg),Pitch (deg),Yaw (deg)", TURNS.as_euler("xyz", degrees=True)),
        ("roll,pitch,yaw", TURNS.as_euler("xyz", degrees=True)),
        ("A,B,C", TURNS.as_euler("ZYX", degrees=True)),
    ],
)
def test_angles_with_telling_names_are_read(
    tmp_path: Path, header: str, values: np.ndarray
) -> None:
    assert_same(turns_of(TableSource(written(tmp_path / "poses.csv", header, values))))


@pytest.mark.parametrize(
    ("rotation", "values"),
    [
        ("rotation-vector", TURNS.as_rotvec()),
        ("euler-xyz", TURNS.as_euler("xyz")),
        ("euler-XYZ", TURNS.as_euler("XYZ")),
        ("euler-zxz", TURNS.as_euler("zxz")),
    ],
)
def test_stated_conventions_are_read(tmp_path: Path, rotation: str, values: np.ndarray) -> None:
    path = written(tmp_path / "poses.csv", "rx,ry,rz", values)
    names = {"t": "t", "x": "x", "y": "y", "z": "z", "a1": "rx", "a2": "ry", "a3": "rz"}
    assert_same(turns_of(TableSource(path, ColumnRules(columns=names, rotation=rotation))))


def test_three_turns_without_a_convention_are_asked_about_by_their_key(tmp_path: Path) -> None:
    source = TableSource(written(tmp_path / "poses.csv", "rx,ry,rz", TURNS.as_rotvec()))
    assert any('state rotation = "euler-xyz"' in one for one in source.warnings)
    with pytest.raises(DatasetError, match=r'state rotation = .* in \[tables."poses.csv"\]'):
        turns_of(source)


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_quaternions_without_named_components_are_read_by_their_stated_order(
    tmp_path: Path, order: str
) -> None:
    quaternions = TURNS.as_quat()
    columns = quaternions if order == "xyzw" else quaternions[:, [3, 0, 1, 2]]
    path = written(tmp_path / "poses.csv", "q1,q2,q3,q4", columns)
    open_one = TableSource(path)
    with pytest.raises(DatasetError, match='state quaternion_order = "xyzw" or "wxyz"'):
        turns_of(open_one)
    assert open_one.rules is not None
    stated = open_one.rules.model_copy(update={"quaternion_order": order})
    assert_same(turns_of(TableSource(path, stated)))


def test_an_axis_twice_in_a_row_is_no_convention() -> None:
    with pytest.raises(ValidationError):
        ColumnRules(columns={}, rotation="euler-xxz")
