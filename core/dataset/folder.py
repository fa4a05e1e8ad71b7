"""A dataset folder: opened once and checked, clouds read one at a time. Nothing in it is ever written to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath

import numpy as np

from core.dataset.cloud import read_cloud, read_header
from core.dataset.files import problem
from core.dataset.schema import FILE, DatasetConfig, nearest, read_config
from core.dataset.table import FIRST_ROW, check_coordinates, check_increasing, read_labelled, read_numbers
from core.errors import DatasetError
from core.frames import FloatArray
from core.progress import Report, silent

__all__ = ["Dataset", "Forces", "Kinematics", "Sequence", "Touches", "open_dataset"]

FEWEST_TOUCHES = 4
LARGEST_FORCE = 1000.0  # N; beyond any bench for soft tissue, so another unit
_BAGS = (".bag", ".db3", ".mcap")


@dataclass(frozen=True, eq=False)
class Touches:
    """Tool centres (n, 3) [m], robot frame, while the tool touched the landmark of the same index."""

    names: tuple[str, ...]
    positions: FloatArray


@dataclass(frozen=True, eq=False)
class Kinematics:
    """The tool's path: time (n,) [s], position (n, 3) [m] and quaternion (n, 4) (x, y, z, w), robot frame."""

    time: FloatArray
    position: FloatArray
    quaternion: FloatArray

    def position_at(self, times: FloatArray) -> FloatArray:
        """Tool centres (m, 3) [m], robot frame, at these times (m,) [s]; linear between rows, beyond the ends the end itself."""
        return np.stack([np.interp(times, self.time, self.position[:, axis]) for axis in range(3)], axis=-1)


@dataclass(frozen=True, eq=False)
class Forces:
    """Force on the tool: time (n,) [s], force (n, 3) [N], robot frame."""

    time: FloatArray
    force: FloatArray


@dataclass(frozen=True, eq=False)
class Sequence:
    """One motion of the tool; its length is the number of clouds.

    Attributes:
        cloud_times: (m,) [s], the clock of the kinematics as far as the experimenter knows.
        cloud_files: (m) paths relative to the dataset.
    """

    root: Path
    name: str
    kinematics: Kinematics
    cloud_times: FloatArray
    cloud_files: tuple[str, ...]
    forces: Forces | None

    def __len__(self) -> int:
        return len(self.cloud_files)

    def count(self, index: int) -> int:
        """Number of points of a cloud, from its header."""
        return read_header(self.root, self.cloud_files[index], within=f"sequences/{self.name}").count

    def cloud(self, index: int) -> FloatArray:
        """The raw cloud (k, 3) [m], camera frame, read from disk at each call."""
        return read_cloud(self.root, self.cloud_files[index], within=f"sequences/{self.name}")


@dataclass(frozen=True, eq=False)
class Dataset:
    """One phantom in one setup with its sequences; `sequences` are their names, sorted."""

    path: Path
    config: DatasetConfig
    touches: Touches
    has_rest: bool
    loaded: tuple[Sequence, ...]

    @property
    def name(self) -> str:
        """The name stated in dataset.toml."""
        return self.config.name

    @cached_property
    def sequences(self) -> tuple[str, ...]:
        """Names of all sequences, sorted."""
        return tuple(sequence.name for sequence in self.loaded)

    def sequence(self, name: str) -> Sequence:
        """The sequence of this name."""
        for sequence in self.loaded:
            if sequence.name == name:
                return sequence
        raise problem(f"sequences/{name}", f"there is no such sequence; {nearest(name, self.sequences)}", value=name)

    def rest_cloud(self) -> FloatArray:
        """The raw cloud (n, 3) [m] of the untouched phantom, camera frame."""
        points = read_cloud(self.path, "rest.ply")
        self._check_span("rest.ply", points)
        return points

    def validate(self, report: Report = silent) -> None:
        """Read every cloud once, so that whatever is wrong in any of them is told now."""
        if self.has_rest:
            self.rest_cloud()
        total = sum(len(sequence) for sequence in self.loaded)
        done = 0
        for sequence in self.loaded:
            for index, file in enumerate(sequence.cloud_files):
                report(done / total, f"reading {sequence.name}, cloud {index + 1} of {len(sequence)}")
                self._check_span(file, sequence.cloud(index))
                done += 1
        report(1.0, f"read {total} clouds")

    def _check_span(self, file: str, points: FloatArray) -> None:
        span, edge = float(np.ptp(points, axis=0).max()), max(self.config.size)
        if len(points) > 1 and span < 0.01 * edge:
            text = f"the cloud spans {span:.3g} m; expected about the phantom, {edge:g} m, or more: is its unit the metre?"
            raise problem(file, text, value=f"{span:.3g}")


def open_dataset(path: Path | str) -> Dataset:
    """Open a dataset folder and check all but the points of its clouds; those are checked when read, or by `validate`."""
    root = Path(path)
    _check_folder(root)
    config = read_config(root)
    touches = _read_touches(root, config)
    sequences = tuple(_read_sequence(root, name) for name in _sequence_names(root))
    _check_splits(config, [sequence.name for sequence in sequences])
    observed = any(len(sequence) for sequence in sequences)
    if observed and not config.has_camera:
        raise problem(FILE, "camera is missing, yet there are clouds; expected this table: add it", key="camera")
    has_rest = observed or (root / "rest.ply").exists()
    if has_rest:
        read_header(root, "rest.ply")
    return Dataset(root, config, touches, has_rest, sequences)


def _check_folder(root: Path) -> None:
    try:
        if root.is_dir():
            list(root.iterdir())
            return
        found = "is a file" if root.exists() else "does not exist"
    except (OSError, ValueError) as error:
        found = f"cannot be opened ({getattr(error, 'strerror', None) or error})"
    raise DatasetError(f"{root} {found}; expected the folder of a dataset, with dataset.toml in it", file=str(root))


def _read_touches(root: Path, config: DatasetConfig) -> Touches:
    file = "touches.csv"
    names, positions = read_labelled(root, file, "landmark,x,y,z", label=0)
    for row, name in enumerate(names, FIRST_ROW):
        if name not in config.landmarks:
            raise problem(
                file, f"unknown landmark '{name}'; {nearest(name, config.landmarks)}", row=row, key="landmark", value=name
            )
        if (first := names.index(name) + FIRST_ROW) != row:
            text = f"landmark '{name}' was touched in row {first} already; expected each once: keep one of them"
            raise problem(file, text, row=row, key="landmark", value=name)
    check_coordinates(file, positions)
    if len(names) < FEWEST_TOUCHES:
        text = (
            f"{len(names)} touches; expected at least {FEWEST_TOUCHES}: three determine a pose without any residual "
            "to judge it by, touch another landmark"
        )
        raise problem(file, text, row=FIRST_ROW + len(names), value=len(names))
    _check_touch_scale(file, positions, np.array([config.landmarks[name] for name in names]))
    return Touches(tuple(names), positions)


def _check_touch_scale(file: str, positions: FloatArray, landmarks: FloatArray) -> None:
    touched, stated = (float(np.linalg.norm(points - points.mean(0), axis=1).max()) for points in (positions, landmarks))
    if stated == 0:
        raise problem(FILE, "landmarks: all touched ones are the same point; expected distinct ones: correct them", key="landmarks")
    if not 0.1 < touched / stated < 10:
        text = f"the touches reach {touched:.3g} m from their centre, the landmarks {stated:.3g} m; expected the same unit, metres"
        raise problem(file, text + ": convert one of them", row=FIRST_ROW, value=f"{touched:.3g}")


def _sequence_names(root: Path) -> list[str]:
    try:
        entries = sorted((entry.name, entry.is_dir()) for entry in (root / "sequences").iterdir() if not entry.name.startswith("."))
    except OSError as error:
        text = f"is no folder that can be read ({error.strerror}); expected one folder per sequence in it: add it"
        raise problem("sequences", text) from None
    for name, _ in entries:
        if name.endswith(_BAGS):
            raise problem(f"sequences/{name}", "bags are not read yet; expected a folder: export it to csv and ply")
        if not name.isprintable():
            raise problem("sequences", f"the name {name!a} cannot be printed; expected letters and digits: rename it")
    names = [name for name, is_folder in entries if is_folder]
    if not names:
        raise problem("sequences", "holds no sequence; expected at least one folder with kinematics.csv: add one")
    return names


def _check_splits(config: DatasetConfig, names: list[str]) -> None:
    for split in ("train", "validation", "test"):
        for name in getattr(config, split):
            if name not in names:
                raise problem(
                    FILE,
                    f"splits.{split} names '{name}', no sequence here; {nearest(name, names)}",
                    key=f"splits.{split}",
                    value=name,
                )


def _read_sequence(root: Path, name: str) -> Sequence:
    home = f"sequences/{name}"
    kinematics = _read_kinematics(root, f"{home}/kinematics.csv")
    times, files = np.empty(0), tuple[str, ...]()
    clouds, forces = f"{home}/clouds.csv", f"{home}/forces.csv"
    has_forces = (root / forces).exists()
    if (root / clouds).exists() or (root / home / "clouds").exists():
        times, files = _read_cloud_list(root, home, clouds, kinematics.time)
    elif not has_forces:
        raise problem(home, "has neither clouds.csv nor forces.csv; expected at least one: add what was measured")
    return Sequence(root, name, kinematics, times, files, _read_forces(root, forces) if has_forces else None)


def _read_kinematics(root: Path, file: str) -> Kinematics:
    table = read_numbers(root, file, "t,x,y,z,qx,qy,qz,qw")
    if len(table) < 2:
        raise problem(file, "has one row; expected a motion of at least two: export this sequence again", row=FIRST_ROW + 1)
    time, position, quaternion = table[:, 0].copy(), table[:, 1:4], table[:, 4:]
    check_increasing(file, time)
    check_coordinates(file, position)
    norms = np.linalg.norm(quaternion, axis=1)
    if len(bad := np.flatnonzero(np.abs(norms - 1) > 1e-2)):
        at = int(bad[0])
        text = f"the quaternion qx,qy,qz,qw has norm {norms[at]:.4g}; expected 1: are the columns in the order of the header?"
        raise problem(file, text, row=at + FIRST_ROW, key="qx,qy,qz,qw", value=f"{norms[at]:.4g}")
    return Kinematics(time, position, quaternion)


def _read_cloud_list(root: Path, home: str, file: str, clock: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    names, numbers = read_labelled(root, file, "t,file", label=1)
    times = numbers[:, 0]
    check_increasing(file, times)
    seen: dict[str, int] = {}
    for row, name in enumerate(names, FIRST_ROW):
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or "\\" in name or not name.isprintable():
            text = (
                f"file = '{name[:80]}' leads out of the sequence; expected a path inside such as clouds/000000.ply: move it there"
            )
            raise problem(file, text, row=row, key="file", value=name[:80])
        if str(path) in seen:
            text = f"file = '{name}' is in row {seen[str(path)]} already; expected one cloud per frame: remove one row"
            raise problem(file, text, row=row, key="file", value=name)
        seen[str(path)] = row
        _check_cloud(root, home, file, row, name)
    if times[-1] < clock[0] or times[0] > clock[-1]:
        text = (
            f"clouds from t = {times[0]:.3f} to {times[-1]:.3f} s, kinematics from {clock[0]:.3f} to {clock[-1]:.3f} s; "
            "expected the same clock and an overlap: convert the stamps to one clock"
        )
        raise problem(file, text, row=FIRST_ROW, key="t", value=f"{times[0]:.3f}")
    return times, tuple(f"{home}/{name}" for name in names)


def _check_cloud(root: Path, home: str, file: str, row: int, name: str) -> None:
    try:
        read_header(root, f"{home}/{name}", within=home)
    except DatasetError as error:
        # Both places matter: the broken cloud is the file, the row is the one that asks for it.
        where = {"row": row, **error.where}
        raise DatasetError(f"{error.message} (asked for by {file}, row {row})", **where) from None


def _read_forces(root: Path, file: str) -> Forces:
    table = read_numbers(root, file, "t,fx,fy,fz")
    time, force = table[:, 0], table[:, 1:]
    check_increasing(file, time)
    if len(bad := np.argwhere(np.abs(force) > LARGEST_FORCE)):
        at, axis = (int(index) for index in bad[0])
        key = ("fx", "fy", "fz")[axis]
        text = f"{key} = {force[at, axis]:g} N; expected at most {LARGEST_FORCE:g} N on soft tissue: did you write millinewtons?"
        raise problem(file, text, row=at + FIRST_ROW, key=key, value=f"{force[at, axis]:g}")
    return Forces(time, force)
