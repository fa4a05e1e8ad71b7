"""Sequences: kinematics, forces, and clouds on demand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np

from palpate.dataset.cloud import read_cloud, read_header
from palpate.dataset.csv_table import (
    FIRST_ROW,
    check_coordinates,
    check_increasing,
    read_labelled,
    read_numbers,
)
from palpate.dataset.files import problem
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = [
    "CLOUDS",
    "FORCES",
    "KINEMATICS",
    "Forces",
    "Kinematics",
    "Sequence",
    "read_cloud_list",
    "read_forces",
    "read_kinematics",
    "read_sequence",
]

KINEMATICS, CLOUDS, FORCES = "t,x,y,z,qx,qy,qz,qw", "t,file", "t,fx,fy,fz"
"""Headers of a sequence's tables."""

LARGEST_FORCE = 1000.0
"""Largest plausible force on soft tissue [N]; a larger one has another unit."""
SLOWEST_STEP = 0.5
"""Largest step of a stream of the kinematics [s]; a larger one is of depth steps at rest, or has
another unit."""
SHORTEST = 0.3
"""Least duration of a recording [s]: rows that would last less in milliseconds are in seconds."""


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Path of the tool, robot frame.

    Attributes:
        time: (n,) [s].
        position: (n, 3) tool centre [m].
        quaternion: (n, 4) orientation (x, y, z, w).
    """

    time: FloatArray
    position: FloatArray
    quaternion: FloatArray

    def position_at(self, times: FloatArray) -> FloatArray:
        """Tool centres (m, 3) [m], robot frame, at times (m,) [s]; linear between rows, constant
        beyond the ends.
        """
        return np.stack(
            [np.interp(times, self.time, self.position[:, axis]) for axis in range(3)], axis=-1
        )


@dataclass(frozen=True, eq=False)
class Forces:
    """Force on the tool, robot frame.

    Attributes:
        time: (n,) [s].
        force: (n, 3) [N].
        sigma: stated standard deviation of one component from the true force, beside noise and
            bias [N].
    """

    time: FloatArray
    force: FloatArray
    sigma: float = 0.0


@dataclass(frozen=True, eq=False)
class Sequence:
    """One motion of the tool; its length is the number of clouds.

    Attributes:
        root: of the dataset.
        name: of the sequence.
        kinematics: of the tool.
        cloud_times: (m,) [s], stated to be on the clock of the kinematics.
        cloud_files: (m) paths relative to the dataset.
        forces: None without.
        shift: (3,) by which clouds are moved on reading [m], camera frame; None without.
    """

    root: Path
    name: str
    kinematics: Kinematics
    cloud_times: FloatArray
    cloud_files: tuple[str, ...]
    forces: Forces | None
    shift: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.cloud_files)

    def count(self, index: int) -> int:
        """Number of points of a cloud, from its header."""
        return read_header(
            self.root, self.cloud_files[index], within=f"sequences/{self.name}"
        ).count

    def cloud(self, index: int) -> FloatArray:
        """Read the raw cloud (k, 3) [m], camera frame, from disk."""
        points = read_cloud(self.root, self.cloud_files[index], within=f"sequences/{self.name}")
        return points if self.shift is None else points + self.shift

    def moved(self, camera: FloatArray, robot: FloatArray) -> Sequence:
        """The sequence with clouds and tool moved by one vector.

        Args:
            camera: (3,) the vector in the camera frame [m].
            robot: (3,) the vector in the robot frame [m].
        """
        path = replace(self.kinematics, position=self.kinematics.position + robot)
        return replace(
            self, kinematics=path, shift=camera if self.shift is None else self.shift + camera
        )


def read_sequence(
    root: Path, name: str, force_sigma: float = 0.0, at_rest: bool = False
) -> Sequence:
    """Read and check a sequence, without the points of its clouds.

    Args:
        root: of the dataset.
        name: of the sequence.
        force_sigma: stated standard deviation of a force [N].
        at_rest: whether rows are stated to be depth steps at rest.
    """
    home = f"sequences/{name}"
    kinematics = read_kinematics(root, f"{home}/kinematics.csv", at_rest)
    times, files = np.empty(0), tuple[str, ...]()
    clouds, forces = f"{home}/clouds.csv", f"{home}/forces.csv"
    has_forces = (root / forces).exists()
    if (root / clouds).exists() or (root / home / "clouds").exists():
        times, files = read_cloud_list(root, home, clouds, kinematics.time)
    elif not has_forces:
        raise problem(
            home,
            "has neither clouds.csv nor forces.csv; expected at least one: add what was measured",
        )
    felt = None
    if has_forces:
        felt = replace(read_forces(root, forces), sigma=force_sigma)
        _check_overlap(forces, felt.time, kinematics.time)
    return Sequence(root, name, kinematics, times, files, felt)


def _check_overlap(file: str, time: FloatArray, clock: FloatArray) -> None:
    """Refuse forces of another time than the kinematics: none of them could be used."""
    if time[-1] >= clock[0] and time[0] <= clock[-1]:
        return
    units = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
    fits = [
        unit
        for unit, second in units.items()
        if second * time[-1] >= clock[0] and second * time[0] <= clock[-1]
    ]
    hint = f"did you write {fits[0]}?" if fits else "convert the stamps to one clock"
    text = (
        f"forces from t = {time[0]:.3f} to {time[-1]:.3f} s, kinematics from {clock[0]:.3f} to "
        f"{clock[-1]:.3f} s; expected the same clock and an overlap: {hint}"
    )
    raise problem(file, text, row=FIRST_ROW, key="t", value=f"{time[0]:.3f}")


def read_kinematics(root: Path, file: str, at_rest: bool = False) -> Kinematics:
    """Read and check the tool's path from `file`, relative to the dataset `root`.

    Rows `at_rest` are depth steps, between which any time may pass.
    """
    table = read_numbers(root, file, KINEMATICS)
    if len(table) < 2:
        raise problem(
            file,
            "has one row; expected a motion of at least two: export this sequence again",
            row=FIRST_ROW + 1,
        )
    time, position, quaternion = table[:, 0].copy(), table[:, 1:4], table[:, 4:]
    check_increasing(file, time)
    check_coordinates(file, position)
    step, span = float(np.median(np.diff(time))), float(time[-1] - time[0])
    if step > SLOWEST_STEP and not at_rest and span / 1000 > SHORTEST:
        text = (
            f"t steps by {step:g} s; expected a stream of at least {1 / SLOWEST_STEP:g} Hz in "
            "seconds: did you write milliseconds? Depth steps at rest are stated by [motion] "
            'stamps = "synthetic" in dataset.toml'
        )
        raise problem(file, text, row=FIRST_ROW + 1, key="t", value=f"{step:g}")
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(quaternion, axis=1)
    if len(bad := np.flatnonzero(np.abs(norms - 1) > 1e-2)):
        at = int(bad[0])
        text = (
            f"the quaternion qx,qy,qz,qw has norm {norms[at]:.4g}; expected 1: are the "
            "columns in the order of the header?"
        )
        raise problem(file, text, row=at + FIRST_ROW, key="qx,qy,qz,qw", value=f"{norms[at]:.4g}")
    return Kinematics(time, position, quaternion)


def read_cloud_list(
    root: Path, home: str, file: str, clock: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Read and check the list of clouds of a sequence.

    Args:
        root: of the dataset.
        home: folder of the sequence, relative to `root`.
        file: the list, relative to `root`.
        clock: (n,) time stamps of the kinematics [s].

    Returns:
        stamps (m,) [s] and files, relative to `root`.
    """
    names, numbers = read_labelled(root, file, CLOUDS, label=1)
    names = [name.replace("\\", "/") for name in names]
    times = numbers[:, 0]
    check_increasing(file, times)
    seen: dict[str, int] = {}
    for row, name in enumerate(names, FIRST_ROW):
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or not name.isprintable():
            text = (
                f"file = '{name[:80]}' leads out of the sequence; expected a path inside such "
                "as clouds/000000.ply: move it there"
            )
            raise problem(file, text, row=row, key="file", value=name[:80])
        if str(path) in seen:
            text = (
                f"file = '{name}' is in row {seen[str(path)]} already; expected one cloud per "
                "frame: remove one row"
            )
            raise problem(file, text, row=row, key="file", value=name)
        seen[str(path)] = row
        _check_cloud(root, home, file, row, name)
    if times[-1] < clock[0] or times[0] > clock[-1]:
        text = (
            f"clouds from t = {times[0]:.3f} to {times[-1]:.3f} s, kinematics from {clock[0]:.3f} "
            f"to {clock[-1]:.3f} s; "
            "expected the same clock and an overlap: convert the stamps to one clock"
        )
        raise problem(file, text, row=FIRST_ROW, key="t", value=f"{times[0]:.3f}")
    return times, tuple(f"{home}/{name}" for name in names)


def _check_cloud(root: Path, home: str, file: str, row: int, name: str) -> None:
    try:
        read_header(root, f"{home}/{name}", within=home)
    except DatasetError as error:
        # The error names the broken cloud as file, and the row that refers to it.
        where = {"row": row, **error.where}
        raise DatasetError(f"{error.message} (listed in {file}, row {row})", **where) from None


def read_forces(root: Path, file: str) -> Forces:
    """Read and check the forces from `file`, relative to the dataset `root`."""
    table = read_numbers(root, file, FORCES)
    time, force = table[:, 0], table[:, 1:]
    check_increasing(file, time)
    if len(bad := np.argwhere(np.abs(force) > LARGEST_FORCE)):
        at, axis = (int(index) for index in bad[0])
        key = ("fx", "fy", "fz")[axis]
        text = (
            f"{key} = {force[at, axis]:g} N; expected at most {LARGEST_FORCE:g} N on soft "
            "tissue: did you write millinewtons?"
        )
        raise problem(file, text, row=at + FIRST_ROW, key=key, value=f"{force[at, axis]:g}")
    return Forces(time, force)
