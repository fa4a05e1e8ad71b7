"""Tables of depth steps at rest become a dataset of pushes on a made-up time line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from palpate.consistency import check_consistency
from palpate.dataset import open_dataset
from palpate.dataset.check.dataset_summary import check_dataset
from palpate.diagnosis.observation.force_only import observe_forces
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import import_recordings
from palpate.importing.mapping_file import mapping_text, read_mapping
from palpate.importing.sources.opened_sources import open_source
from palpate.importing.sources.probing_source import ProbingSource
from palpate.importing.survey import survey
from palpate.registration.registration import register
from palpate.setup.setup import Setup, Tool

SIZE = (0.07, 0.04, 0.036)
RADIUS = 5e-3
ROBOT = Rotation.from_euler("xyz", [0.1, -0.2, 0.7])
ORIGIN = np.array([0.05, -0.12, 0.16])
MARKS = {
    f"corner_{n}": [a * SIZE[0] / 2, b * SIZE[1] / 2, SIZE[2]]
    for n, (a, b) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)])
}
DEPTHS = np.linspace(0.0, 2.7e-3, 10)
PLACES = [(x, y) for x in (-0.02, -0.01, 0.0, 0.01, 0.02) for y in (-0.01, 0.0, 0.01)]


def rows(sign: float = 1.0, noise: float = 2e-3) -> np.ndarray:
    """Rows of push, place [m], normal, force [N] in the robot frame; each push has a constant, and
    the last steps of every third one were not reached."""
    random, found = np.random.default_rng(4), []
    normal = ROBOT.apply([0.0, 0.0, 1.0])
    for number, (x, y) in enumerate(PLACES):
        constant = 0.1 * random.normal(size=3)
        for at, depth in enumerate(DEPTHS):
            place = ROBOT.apply([x, y, SIZE[2] + RADIUS - depth]) + ORIGIN
            force = sign * 0.4 * (depth / DEPTHS[-1]) ** 1.5 * normal + constant
            row = [*place, *normal, *(force + noise * random.normal(size=3))]
            reached = number % 3 or at < 7
            found.append([number, *(row if reached else np.zeros(9))])
    return np.array(found)


def written(folder: Path, table: np.ndarray, header: str, unit: float = 1.0) -> Path:
    folder.mkdir(exist_ok=True)
    table = table.copy()
    names = header.split(",")
    table[:, [names.index(axis) for axis in "xyz"]] *= unit
    lines = [",".join(f"{value:.9g}" for value in row) for row in table.tolist()]
    (folder / "probing.csv").write_text("\n".join([header, *lines]) + "\n")
    size = ", ".join(map(str, SIZE))
    toml = ["[phantom]", 'geometry = "box"', f"size = [{size}]", "mass = 0.1", 'fixed = "base"']
    toml += ["[tool]", 'shape = "sphere"', f"radius = {RADIUS}", "[landmarks]"]
    toml += [f"{name} = {place}" for name, place in MARKS.items()] + [f"touch_offset = {RADIUS}"]
    (folder / "dataset.toml").write_text("\n".join(toml) + "\n")
    touched = ROBOT.apply(np.add(list(MARKS.values()), [0, 0, RADIUS])) + ORIGIN
    touches = [",".join([n, *map(str, p)]) for n, p in zip(MARKS, touched, strict=True)]
    (folder / "touches.csv").write_text("\n".join(["landmark,x,y,z", *touches]) + "\n")
    return folder


HEADER = "push,x,y,z,nx,ny,nz,fx,fy,fz"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ImportNotes]:
    folder = written(tmp_path_factory.mktemp("probing") / "raw", rows(), HEADER, 1000.0)
    notes = ImportNotes()
    found = survey([folder], None)
    mapping = found.proposal("probing", notes)
    found.close()
    import_recordings(mapping, folder, folder.parent / "made", notes)
    return folder.parent / "made", notes


def test_rows_become_pushes_that_check_accepts(made: tuple[Path, ImportNotes]) -> None:
    dataset = open_dataset(made[0])
    assert dataset.config.synthetic_stamps
    assert dataset.sequences == ("probe-01", "probe-02", "probe-03")
    robot = register(dataset)
    summary = check_dataset(dataset, robot.repaired.phantom_from_robot)
    contacts = [c for one in summary.sequences if one.motion for c in one.motion.contacts]
    assert len(contacts) == len(PLACES) and {one.kind for one in contacts} == {"top"}
    told = [*summary.warnings, *check_consistency(dataset, robot)]
    assert len(told) == 1 and "no measured times" in told[0]


def test_each_push_keeps_its_places_and_forces(made: tuple[Path, ImportNotes]) -> None:
    dataset = open_dataset(made[0])
    table = rows()
    for number, name in enumerate(dataset.sequences):
        own = table[np.isin(table[:, 0] % 3, [number]) & (table[:, 1] != 0)]
        forces = dataset.sequence(name).forces
        assert forces is not None
        np.testing.assert_allclose(forces.force, own[:, 7:10], atol=1e-8)
        at = dataset.sequence(name).kinematics.position_at(forces.time)
        np.testing.assert_allclose(at, own[:, 1:4], atol=1e-8)


def test_a_diagnosis_by_forces_uses_each_push(made: tuple[Path, ImportNotes]) -> None:
    dataset = open_dataset(made[0])
    robot = register(dataset).repaired.phantom_from_robot
    setup = Setup(geometry=dataset.geometry, tool=Tool(radius=RADIUS), phantom_from_robot=robot)
    item = observe_forces(dataset.sequence("probe-02"), setup, most=40)
    assert [group.push for group in item.groups] == sorted([1, 2, 3, 4, 5] * 2)
    measured, _ = item.force_in_groups(robot, 0.0) or (np.zeros((1, 3)), None)
    assert measured[1::2, 2] == pytest.approx([0.4] * 5, abs=0.03)


def test_units_frame_and_made_up_times_are_told(made: tuple[Path, ImportNotes]) -> None:
    notes = made[1]
    assert any("positions are in mm" in one for one in notes.decisions)
    assert any("in the robot frame, sign 1" in one for one in notes.decisions)
    assert not any("[wrench] frame" in one for one in notes.warnings)
    assert any("15 pushes in steps of depth; their stamps are made up" in w for w in notes.warnings)
    mapping = read_mapping(made[0] / "import.toml")
    assert mapping.tables["probing.csv"].rows == "depth-steps"
    assert mapping_text(mapping)


def test_forces_on_the_phantom_are_turned_around(tmp_path: Path) -> None:
    folder = written(tmp_path / "raw", rows(-1.0), HEADER)
    found = survey([folder], None)
    assert found.proposal("probing", ImportNotes()).wrench.sign == -1
    found.close()


@pytest.mark.parametrize(
    ("columns", "header"),
    [([0, 1, 2, 3, 7, 8, 9], "push,x,y,z,fx,fy,fz"), ([1, 2, 3, 7, 8, 9], "x,y,z,fx,fy,fz")],
)
def test_pushes_are_found_without_normals_or_numbers(
    tmp_path: Path, columns: list[int], header: str
) -> None:
    folder = written(tmp_path / "raw", rows()[:, columns], header)
    source = open_source(folder / "probing.csv")
    assert isinstance(source, ProbingSource)
    assert f"{len(PLACES)} pushes" in source.warnings[-1]
    assert source.force_sign() == 1


def test_rows_with_slow_stamps_are_depth_steps_and_quick_ones_a_stream(tmp_path: Path) -> None:
    for step, at_rest in ((1.57, True), (0.01, False)):
        table = np.column_stack([step * np.arange(len(rows())), rows()])
        folder = written(tmp_path / f"raw-{step}", table, f"t,{HEADER}")
        assert isinstance(open_source(folder / "probing.csv"), ProbingSource) == at_rest


def test_a_stream_without_times_is_no_push(tmp_path: Path) -> None:
    path = np.column_stack([np.zeros((400, 2)), 0.1 + 0.02 * np.sin(0.05 * np.arange(400))])
    table = np.column_stack([path, np.ones((400, 3))])
    folder = written(tmp_path / "raw", table, "x,y,z,fx,fy,fz")
    source = open_source(folder / "probing.csv")
    assert [one.kind for one in source.streams()] == ["other"]
