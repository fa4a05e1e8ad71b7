"""Ways in which the files of a recorded dataset lie: each changes a sound dataset in place."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from small_dataset import ply_bytes

from palpate.dataset.cloud import read_cloud
from palpate.foundation.frames import Transform

__all__ = ["DECEPTIONS", "Deception", "cloud_files", "read_table", "write_table"]

Change = Callable[[Path], None]
Table = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Deception:
    """One way to lie.

    Attributes:
        kind: letter of its kind.
        change: of the files of a dataset.
        told: pattern of what is told about it.
    """

    kind: str
    change: Change
    told: str


def read_table(path: Path) -> tuple[str, Table]:
    """Header and numbers of a table."""
    header = path.read_text().splitlines()[0]
    return header, np.loadtxt(path, delimiter=",", skiprows=1)


def write_table(path: Path, header: str, rows: Table) -> None:
    lines = [",".join([f"{row[0]:.6f}", *(f"{value:.9g}" for value in row[1:])]) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n")


def homes(folder: Path) -> list[Path]:
    return sorted((folder / "sequences").iterdir())


def cloud_files(home: Path) -> list[Path]:
    """Files of a sequence's clouds in order of time."""
    rows = (home / "clouds.csv").read_text().split()[1:]
    return [home / row.split(",")[1] for row in rows]


def truth(folder: Path) -> tuple[Transform, Transform]:
    """True poses robot_from_phantom and phantom_from_camera of a dataset of the bench."""
    stated = json.loads(Path(f"{folder}.truth.json").read_text())["registration"]
    robot = Transform(
        np.array(stated["robot_from_phantom_R"]), np.array(stated["robot_from_phantom_t"])
    )
    return robot, Transform.from_matrix(stated["phantom_from_camera"])


def _table(file: str, change: Callable[[Table], Table], which: int | None) -> Change:
    """Change the rows of a table of all sequences, or of the sequence of this number."""

    def apply(folder: Path) -> None:
        for number, home in enumerate(homes(folder)):
            if which is None or number == which:
                header, rows = read_table(home / file)
                write_table(home / file, header, change(rows))

    return apply


def forces(change: Callable[[Table], Table], which: int | None = None) -> Change:
    """Change the rows t, fx, fy, fz of all forces, or of the sequence of this number."""
    return _table("forces.csv", change, which)


def columns(change: Callable[[Table], Table]) -> Change:
    """Change the vectors (n, 3) of all forces."""
    return forces(lambda rows: np.column_stack([rows[:, 0], change(rows[:, 1:])]))


def stamps(change: Callable[[Table], Table]) -> Change:
    """Change the stamps (n,) of all forces."""
    return forces(lambda rows: np.column_stack([change(rows[:, 0]), rows[:, 1:]]))


def _scaled(*factors: float) -> Change:
    return columns(lambda force: force * np.array(factors))


def _norm_along(axis: int) -> Change:
    return columns(lambda force: np.linalg.norm(force, axis=1)[:, None] * np.eye(3)[axis])


def _constant(value: float, noise: float = 0.0) -> Change:
    random = np.random.default_rng(0)
    return columns(lambda force: np.asarray(value + noise * random.normal(size=force.shape)))


def _in_tool_frame(folder: Path) -> None:
    for home in homes(folder):
        _, poses = read_table(home / "kinematics.csv")
        header, rows = read_table(home / "forces.csv")
        row = np.clip(np.searchsorted(poses[:, 0], rows[:, 0]), 0, len(poses) - 1)
        turned = Rotation.from_quat(poses[row, 4:]).inv().apply(rows[:, 1:])
        write_table(home / "forces.csv", header, np.column_stack([rows[:, 0], turned]))


def _of_another_sequence(folder: Path) -> None:
    paths = [home / "forces.csv" for home in homes(folder)]
    tables = [read_table(path) for path in paths]
    for path, (header, own), (_, other) in zip(paths, tables, tables[1:] + tables[:1], strict=True):
        times = other[:, :1] - other[0, 0] + own[0, 0]
        write_table(path, header, np.column_stack([times, other[:, 1:]]))


def touches(change: Callable[[Table], Table]) -> Change:
    """Change the positions (n, 3) of touches.csv."""

    def apply(folder: Path) -> None:
        path = folder / "touches.csv"
        header, *rows = path.read_text().split()
        names = [row.split(",")[0] for row in rows]
        moved = change(np.array([[float(v) for v in row.split(",")[1:]] for row in rows]))
        lines = [f"{n},{x:.7f},{y:.7f},{z:.7f}" for n, (x, y, z) in zip(names, moved, strict=True)]
        path.write_text("\n".join([header, *lines]) + "\n")

    return apply


def _touched_elsewhere(folder: Path, away: tuple[float, float, float]) -> None:
    robot, _ = truth(folder)
    touches(lambda places: places + robot.rotate(np.array(away)))(folder)


def clouds(change: Callable[[Table], Table], *, rest: bool = True, frames: bool = True) -> Change:
    """Change the points (n, 3), camera frame, of rest cloud and frames."""

    def apply(folder: Path) -> None:
        files = [folder / "rest.ply"] if rest else []
        files += [file for home in homes(folder) for file in cloud_files(home)] if frames else []
        for file in files:
            points = change(read_cloud(folder, str(file.relative_to(folder))))
            file.write_bytes(ply_bytes(points))

    return apply


def _rest(change: Callable[[Table, Table], Table]) -> Change:
    """Change the rest cloud, given its points in the camera and in the phantom frame."""

    def apply(folder: Path) -> None:
        pose = truth(folder)[1]
        clouds(lambda points: change(points, pose.apply(points)), frames=False)(folder)

    return apply


def _half_missing(points: Table, phantom: Table) -> Table:
    return points[~((phantom[:, 2] > 0.004) & (phantom[:, 0] > 0.0))]


def _moved_rest(way: tuple[float, float, float], degrees: float, *, table: bool = False) -> Change:
    """Take the rest cloud before the phantom, or the camera, was moved."""

    def apply(folder: Path) -> None:
        pose = truth(folder)[1]

        def change(points: Table) -> Table:
            phantom = pose.apply(points)
            own = np.ones(len(points), bool)
            if not table:
                own = (phantom[:, 2] > 0.003) & (np.abs(phantom[:, :2]) < 0.06).all(axis=1)
            turned = Rotation.from_euler("z", degrees, degrees=True).apply(phantom) + way
            return np.where(own[:, None], pose.inverse().apply(turned), points)

        clouds(change, frames=False)(folder)

    return apply


def _landmarks(change: Callable[[Table], Table]) -> Change:
    def apply(folder: Path) -> None:
        path = folder / "dataset.toml"
        head, body = path.read_text().split("[landmarks]\n")
        own, tail = body.split("\n[", 1)
        found = re.findall(r"^(\w+) = \[(.*)\]", own, re.MULTILINE)
        places = change(np.array([[float(v) for v in row.split(",")] for _, row in found]))
        rows = [f"{n} = {p.tolist()}" for (n, _), p in zip(found, places, strict=True)]
        rest = [line for line in own.splitlines() if "[" not in line]
        path.write_text(head + "\n".join(["[landmarks]", *rows, *rest]) + "\n[" + tail)

    return apply


def _turned(degrees: float) -> Change:
    turn = Rotation.from_euler("z", degrees, degrees=True)
    return _landmarks(turn.apply)


def toml(pattern: str, replacement: str) -> Change:
    """Change dataset.toml."""

    def apply(folder: Path) -> None:
        path = folder / "dataset.toml"
        text, count = re.subn(pattern, replacement, path.read_text(), flags=re.MULTILINE)
        assert count, f"{pattern} is not in {path}"
        path.write_text(text)

    return apply


def poses(change: Callable[[Table], Table], which: int | None = None) -> Change:
    """Change the rows of all kinematics, or of the sequence of this number."""
    return _table("kinematics.csv", change, which)


def _spoilt(rows: Table, seconds: float, value: Table | None, shift: float = 0.0) -> Table:
    """Put a wrong position at the middle of the motion."""
    rows = rows.copy()
    middle = rows[len(rows) // 2, 0]
    bad = (rows[:, 0] >= middle) & (rows[:, 0] < middle + seconds)
    rows[bad, 1:4] = rows[bad, 1:4] + shift if value is None else value
    return rows


def _frozen(rows: Table, start: float, seconds: float, noise: float = 0.0) -> Table:
    rows = rows.copy()
    begin = rows[0, 0] + start * (rows[-1, 0] - rows[0, 0])
    stuck = np.flatnonzero((rows[:, 0] >= begin) & (rows[:, 0] < begin + seconds))
    rows[stuck, 1:] = rows[stuck[0], 1:]
    rows[stuck, 1:4] += noise * np.random.default_rng(1).normal(size=(len(stuck), 3))
    return rows


def _mirrored_robot(folder: Path) -> None:
    flip = np.array([1.0, -1.0, 1.0])
    touches(lambda places: places * flip)(folder)
    poses(lambda rows: np.column_stack([rows[:, 0], rows[:, 1:4] * flip, rows[:, 4:]]))(folder)
    columns(lambda force: force * flip)(folder)


def _cloud_stamps(change: Callable[[Table, int], Table]) -> Change:
    def apply(folder: Path) -> None:
        for number, home in enumerate(homes(folder)):
            header, *rows = (home / "clouds.csv").read_text().split()
            files = [row.split(",")[1] for row in rows]
            times = change(np.array([float(row.split(",")[0]) for row in rows]), number)
            lines = [f"{t:.6f},{file}" for t, file in zip(times, files, strict=True)]
            (home / "clouds.csv").write_text("\n".join([header, *lines]) + "\n")

    return apply


def _repeated(every: int) -> Change:
    """Repeat the cloud before in every second (or third, ...) frame."""

    def apply(folder: Path) -> None:
        for home in homes(folder):
            files = cloud_files(home)
            for index in range(1, len(files), every):
                files[index].write_bytes(files[index - 1].read_bytes())

    return apply


def _stuck_camera(folder: Path) -> None:
    for home in homes(folder):
        files = cloud_files(home)
        for file in files[len(files) // 3 :]:
            file.write_bytes(files[len(files) // 3].read_bytes())


def _w_first(rows: Table) -> Table:
    return np.column_stack([rows[:, :4], rows[:, 7], rows[:, 4:7]])


def _conjugated(rows: Table) -> Table:
    return np.column_stack([rows[:, :4], -rows[:, 4:7], rows[:, 7]])


def _without_tool(folder: Path) -> None:
    """Leave out of the clouds what lies over the phantom, as a mask of the tool does."""
    pose = truth(folder)[1]
    robot, _ = truth(folder)
    for home in homes(folder):
        _, rows = read_table(home / "kinematics.csv")
        times = [float(row.split(",")[0]) for row in (home / "clouds.csv").read_text().split()[1:]]
        for time, file in zip(times, cloud_files(home), strict=True):
            points = read_cloud(folder, str(file.relative_to(folder)))
            row = int(np.clip(np.searchsorted(rows[:, 0], time), 0, len(rows) - 1))
            tip = robot.inverse().apply(rows[row, 1:4][None])[0]
            tail = tip + 0.3 * robot.inverse().rotate(
                Rotation.from_quat(rows[row, 4:]).apply([0.0, 0.0, -1.0])
            )
            way = (tail - tip) / np.linalg.norm(tail - tip)
            seen = pose.apply(points) - tip
            along = np.clip(seen @ way, 0.0, 0.3)
            away = np.linalg.norm(seen - along[:, None] * way, axis=1)
            file.write_bytes(ply_bytes(points[away > 0.009]))


DECEPTIONS: dict[str, Deception] = {
    "forces: sign": Deception("A", _scaled(-1, -1, -1), r"opposite sign"),
    "forces: sign of z": Deception("A", _scaled(1, 1, -1), r"sign of fz reversed"),
    "forces: sign of x": Deception("A", _scaled(-1, 1, 1), r"sign of fx reversed"),
    "forces: y and z swapped": Deception("A", columns(lambda f: f[:, [0, 2, 1]]), r"as fx, fz, fy"),
    "forces: grams": Deception("A", _scaled(*[1e3 / 9.81] * 3), r"in grams"),
    "forces: millinewtons": Deception("A", _scaled(1e3, 1e3, 1e3), r"in millinewtons"),
    "forces: kilograms": Deception("A", _scaled(*[1 / 9.81] * 3), r"in kilograms"),
    "forces: tool frame": Deception("A", _in_tool_frame, r"in the tool's frame"),
    "forces: norm as fz": Deception("A", _norm_along(2), r"changes in fz alone"),
    "forces: norm as fx": Deception("A", _norm_along(0), r"changes in fx alone"),
    "forces: one value": Deception("A", _constant(0.25), r"holds one value throughout"),
    "forces: zero": Deception("A", _constant(0.0), r"holds one value throughout"),
    "forces: noise alone": Deception("A", _constant(0.1, 0.005), r"does not follow the pushes"),
    "forces: 3 s late": Deception("A", stamps(lambda t: t + 3.0), r"s late"),
    "forces: 2 s early": Deception("A", stamps(lambda t: t - 2.0), r"2.00 s early"),
    "forces: since 1970": Deception(
        "A", stamps(lambda t: t + 1.6e9), r"expected the same clock and an overlap"
    ),
    "forces: milliseconds": Deception(
        "A", stamps(lambda t: 1e3 * t), r"did you write milliseconds"
    ),
    "forces: ms from 0": Deception(
        "A", stamps(lambda t: t[0] + 1e3 * (t - t[0])), r"in milliseconds"
    ),
    "forces: first third": Deception(
        "A", forces(lambda rows: rows[: len(rows) // 3]), r"covers 0% of the time in contact"
    ),
    "forces: last third": Deception(
        "A", forces(lambda rows: rows[-(len(rows) // 3) :]), r"% of the time in contact"
    ),
    "forces: another sequence's": Deception(
        "A", _of_another_sequence, r"forces.csv of .*(early|late|covers|along|not follow)"
    ),
    "forces: clipped": Deception("A", columns(lambda f: np.clip(f, -0.15, 0.15)), r"at its limit"),
    "touches: 25 mm along x": Deception(
        "B",
        lambda f: _touched_elsewhere(f, (0.025, 0, 0)),
        r"camera sees the tool 26 mm .* by \(\+25",
    ),
    "touches: 20 mm along y": Deception(
        "B", lambda f: _touched_elsewhere(f, (0, 0.02, 0)), r"camera sees the tool 21 mm"
    ),
    "touches: 20 mm lower": Deception(
        "B", lambda f: _touched_elsewhere(f, (0, 0, -0.02)), r"camera sees the tool 2. mm"
    ),
    "rest: half missing": Deception("B", _rest(_half_missing), r"camera sees the tool"),
    "rest: 90 degrees": Deception("B", _moved_rest((0.03, 0.02, 0), 90.0, table=True), r"rest.ply"),
    "rest: 30 mm": Deception(
        "B",
        _moved_rest((0.03, 0.0, 0), 0.0, table=True),
        r"30 mm and 0 degrees from where rest.ply",
    ),
    "size: x and y swapped": Deception(
        "B", toml(r"^size = \[([^,]*), ([^,]*),", r"size = [\2, \1,"), r"x and y swapped"
    ),
    "clouds: x mirrored": Deception(
        "C", clouds(lambda p: p * np.array([-1, 1, 1])), r"is mirrored"
    ),
    "clouds: y mirrored": Deception(
        "C", clouds(lambda p: p * np.array([1, -1, 1])), r"is mirrored"
    ),
    "clouds: x and y swapped": Deception("C", clouds(lambda p: p[:, [1, 0, 2]]), r"is mirrored"),
    "robot: y mirrored": Deception("C", _mirrored_robot, r"is mirrored|wrong landmarks"),
    "rest: phantom 12 mm": Deception(
        "D", _moved_rest((0.012, 0, 0), 0.0), r"12 mm and 0 degrees from where rest.ply"
    ),
    "rest: phantom 12 mm, 10 degrees": Deception(
        "D", _moved_rest((0.009, 0.008, 0), 10.0), r"10 degrees from where rest.ply"
    ),
    "rest: phantom 10 degrees": Deception(
        "D", _moved_rest((0, 0, 0), 10.0), r"10 degrees from where rest.ply"
    ),
    "rest: camera 12 mm": Deception(
        "D",
        _moved_rest((0.0, 0.012, 0), 0.0, table=True),
        r"12 mm and 0 degrees from where rest.ply",
    ),
    "landmarks: 17 mm along x": Deception(
        "E",
        _landmarks(lambda p: p + np.array([0.017, 0, 0])),
        r"if they are moved by \(-17.0, \+0.0, \+0.0\) mm",
    ),
    "landmarks: 17 mm along y": Deception(
        "E",
        _landmarks(lambda p: p + np.array([0, 0.017, 0])),
        r"if they are moved by \(\+0.0, -17.0, \+0.0\) mm",
    ),
    "landmarks: 6 mm higher": Deception(
        "E", _landmarks(lambda p: p + np.array([0, 0, 0.006])), r"if they are moved by"
    ),
    "landmarks: 90 degrees": Deception("E", _turned(90.0), r"turned by 90 degrees"),
    "landmarks: 15 % larger": Deception(
        "E", _landmarks(lambda p: 1.15 * p), r"multiplied by 0.8[67]"
    ),
    "landmarks: mirrored": Deception(
        "E", _landmarks(lambda p: p * np.array([-1, 1, 1])), r"wrong landmarks"
    ),
    "robot: zeros": Deception("F", poses(lambda r: _spoilt(r, 0.02, np.zeros(3))), r"jumps"),
    "robot: jump": Deception("F", poses(lambda r: _spoilt(r, 0.005, None, 0.02), 0), r"jumps"),
    "robot: frozen": Deception("F", poses(lambda r: _frozen(r, 0.3, 6.0), 0), r"stands still"),
    "robot: frozen with noise": Deception(
        "F", poses(lambda r: _frozen(r, 0.55, 3.5, 5e-5), 1), r"the stream of the robot stood still"
    ),
    "camera: every second repeated": Deception("F", _repeated(2), r"byte for byte"),
    "camera: every fifth repeated": Deception("F", _repeated(5), r"byte for byte"),
    "camera: frozen": Deception("F", _stuck_camera, r"byte for byte"),
    "camera: 3 % fast": Deception(
        "F", _cloud_stamps(lambda t, _: t[0] + 1.03 * (t - t[0])), r"% fast"
    ),
    "camera: an offset each": Deception(
        "F",
        _cloud_stamps(lambda t, n: t + (0.0, 0.8, -0.6, 0.3)[n % 4]),
        r"another time in each sequence",
    ),
    "camera: 2 s late": Deception("F", _cloud_stamps(lambda t, _: t + 2.0), r"2.00 s late"),
    "quaternions: w first": Deception("G", poses(_w_first), r"qw in the first"),
    "quaternions: inverse": Deception("G", poses(_conjugated), r"inverted"),
    "clouds: tool masked": Deception("G", _without_tool, r"no tool is seen"),
    "mass: 20 700 kg/m3": Deception("H", toml(r"^mass = .*", "mass = 2.0"), r"kg/m3"),
    "mass: in tonnes": Deception("H", toml(r"^mass = .*", "mass = 0.0001"), r"kg/m3"),
    "radius: 40 mm": Deception("H", toml(r"^radius = .*", "radius = 0.04"), r"ball of 80 mm"),
}
