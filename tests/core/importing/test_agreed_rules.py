"""Units and rotations that a table leaves open are settled by what is stated, or asked about."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from palpate.importing.import_notes import ImportNotes
from palpate.importing.sources.table_source import TableSource
from palpate.importing.survey import Survey, survey
from palpate.setup.setup import Box

SIZE = (0.07, 0.04, 0.036)
MARKS = {
    f"corner_{n}": [a * SIZE[0] / 2, b * SIZE[1] / 2, SIZE[2]]
    for n, (a, b) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)])
}
ROBOT = Rotation.from_euler("xyz", [np.pi - 0.2, 0.1, 0.7])
"""Robot frame from phantom frame; its z axis points down."""
ORIGIN = np.array([0.05, -0.12, 0.16])
SECONDS = np.arange(200) * 0.02
HELD = Rotation.from_euler(
    "xyz", np.stack([0.25 * np.sin(SECONDS), 0.2 * np.cos(SECONDS), 0.3 + 0.1 * SECONDS], axis=-1)
)
"""The tool in a frame in which the phantom is below along z: within 20 degrees of it."""


def pushes() -> tuple[np.ndarray, Rotation]:
    """Places [m] and rotations of a tool that pushes from above, robot frame."""
    assert Box(size=SIZE).height == SIZE[2]
    depth = 0.003 * np.sin(2 * SECONDS) - 0.01
    local = np.stack([0.02 * np.sin(1.7 * SECONDS), 0.01 * np.cos(SECONDS), SIZE[2] - depth], -1)
    down = Rotation.from_euler("x", np.pi)
    return ROBOT.apply(local) + ORIGIN, ROBOT * down * HELD


def dataset_toml(folder: Path, with_touches: bool = True) -> Path:
    size = ", ".join(map(str, SIZE))
    lines = ["[phantom]", 'geometry = "box"', f"size = [{size}]", "[landmarks]"]
    lines += [f"{name} = {place}" for name, place in MARKS.items()]
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n")
    if with_touches:
        places = ROBOT.apply(list(MARKS.values())) + ORIGIN
        rows = [",".join([name, *map(str, p)]) for name, p in zip(MARKS, places, strict=True)]
        (folder / "touches.csv").write_text("\n".join(["landmark,x,y,z", *rows]) + "\n")
    return folder / "dataset.toml"


def surveyed(folder: Path, columns: dict[str, np.ndarray], touched: bool = True) -> Survey:
    header, body = ",".join(columns), np.column_stack(list(columns.values()))
    rows = [",".join(f"{value:.9f}" for value in row) for row in body.tolist()]
    (folder / "poses.csv").write_text("\n".join([header, *rows]) + "\n")
    setup = dataset_toml(folder, touched)
    paths = [folder / "poses.csv", *([folder / "touches.csv"] if touched else [])]
    return survey(paths, setup)


def settled(found: Survey) -> tuple[Any, ImportNotes]:
    notes = ImportNotes()
    rules = found.proposal("name", notes).tables["poses.csv"]
    return rules, notes


def places_in(unit: float) -> dict[str, np.ndarray]:
    places, _ = pushes()
    return {"t": SECONDS, **dict(zip("xyz", unit * places.T, strict=True))}


@pytest.mark.parametrize(("unit", "per_metre"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
@pytest.mark.parametrize("touched", [True, False])
def test_lengths_take_the_unit_in_which_the_path_is_at_the_phantom(
    tmp_path: Path, unit: str, per_metre: float, touched: bool
) -> None:
    rules, notes = settled(surveyed(tmp_path, places_in(per_metre), touched))
    if touched or unit != "cm":
        assert rules.length_unit == unit
        assert not any("positions" in one for one in notes.warnings) or not touched
    else:  # a path of 40 mm or 4 mm over a phantom of 70 mm: both may be
        assert any("may be in cm or mm" in one and "length_unit" in one for one in notes.warnings)


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_the_order_of_a_quaternion_is_the_one_that_points_the_tool_into_the_phantom(
    tmp_path: Path, order: str
) -> None:
    turns = pushes()[1].as_quat()
    parts = turns if order == "xyzw" else turns[:, [3, 0, 1, 2]]
    columns = places_in(1.0) | {f"q{n + 1}": parts[:, n] for n in range(4)}
    rules, notes = settled(surveyed(tmp_path, columns))
    assert rules.quaternion_order == order
    assert any("degrees from the direction into the phantom" in one for one in notes.decisions)


def test_the_order_of_a_quaternion_is_asked_for_without_evidence(tmp_path: Path) -> None:
    turns = pushes()[1].as_quat()
    columns = places_in(1.0) | {f"q{n + 1}": turns[:, n] for n in range(4)}
    rules, notes = settled(surveyed(tmp_path, columns, touched=False))
    assert rules.quaternion_order == ""
    assert any('state quaternion_order = "xyzw" or "wxyz"' in one for one in notes.warnings)


@pytest.mark.parametrize(
    ("kind", "degrees"), [("euler-xyz", True), ("euler-xyz", False), ("rotation-vector", False)]
)
def test_turns_about_three_axes_are_read_as_what_is_smooth_and_points_into_the_phantom(
    tmp_path: Path, kind: str, degrees: bool
) -> None:
    turns = pushes()[1]
    angles = turns.as_rotvec() if kind == "rotation-vector" else turns.as_euler("xyz")
    angles = np.degrees(angles) if degrees else angles
    columns = places_in(1.0) | dict(zip(("rx", "ry", "rz"), angles.T, strict=True))
    found = surveyed(tmp_path, columns)
    rules, notes = settled(found)
    assert rules.angle_unit == ("deg" if degrees else "rad")
    if rules.rotation:
        source = found.recordings[0].sources[0]
        read = Rotation.from_quat([s.value()[3:] for s in source.samples({"poses.csv#pose"})])
        assert (read.inv() * turns).magnitude().max() < 1e-6
    else:
        assert any("state rotation" in one for one in notes.warnings)


@pytest.mark.parametrize(("unit", "per_second"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_times_take_the_unit_in_which_streams_last_alike(
    tmp_path: Path, unit: str, per_second: float
) -> None:
    columns = places_in(1.0) | {"t": SECONDS * per_second}
    start = 1_700_000_000
    rows = [f"{start + t:.3f},0.1,0.0,{t / 10:.4f}" for t in SECONDS]
    (tmp_path / "force.csv").write_text("\n".join(["t,fx,fy,fz", *rows]) + "\n")
    found = surveyed(tmp_path, columns)
    found.recordings[0] = type(found.recordings[0])(
        "poses", (*found.recordings[0].sources, TableSource(tmp_path / "force.csv"))
    )
    rules, notes = settled(found)
    assert rules.time_unit == unit
    assert any(f"times are in {unit}" in one for one in notes.decisions)


def test_a_preview_shows_the_first_rows_in_metres_and_quaternions(tmp_path: Path) -> None:
    angles = pushes()[1].as_euler("xyz", degrees=True)
    columns = places_in(1000.0) | dict(zip(("roll", "pitch", "yaw"), angles.T, strict=True))
    found = surveyed(tmp_path, columns | {"gripper": SECONDS})
    settled(found)
    (preview,) = found.recordings[0].previews(rows=2)
    by = {one.quantity: one for one in preview.columns}
    assert preview.rows == 200 and preview.unused == ("gripper",)
    assert (by["x"].column, by["x"].written, by["x"].unit) == ("x", "mm", "m")
    assert [float(one) for one in by["x"].values] == pytest.approx(pushes()[0][:2, 0], rel=1e-4)
    assert by["qw"].written == "euler-xyz deg" and by["qw"].column == "roll, pitch, yaw"
    first = Rotation.from_quat([float(by[part].values[0]) for part in ("qx", "qy", "qz", "qw")])
    assert (first.inv() * pushes()[1][0]).magnitude() < 1e-3
