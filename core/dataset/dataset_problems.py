"""All problems of a dataset folder at once, so that they can be corrected together."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from palpate.dataset.cloud import read_cloud
from palpate.dataset.contact_points import TOUCHES, TRACES, read_touches, read_traces
from palpate.dataset.csv_table import read_labelled, row_problems
from palpate.dataset.folder import (
    check_folder,
    check_span,
    check_splits,
    open_dataset,
    sequence_names,
    stated,
)
from palpate.dataset.schema import DatasetConfig
from palpate.dataset.sequence import (
    CLOUDS,
    FORCES,
    KINEMATICS,
    read_cloud_list,
    read_forces,
    read_kinematics,
)
from palpate.foundation.errors import DatasetError, PalpateError
from palpate.foundation.progress import Report, silent

__all__ = ["MOST", "find_problems", "refuse_problems"]

MOST = 100
"""Largest number of problems that are listed."""
T = TypeVar("T")


def refuse_problems(root: Path, report: Report = silent) -> None:
    """Raise a DatasetError that lists all problems of a folder, one a line, if there are any.

    Its place is that of the first problem.
    """
    problems = find_problems(root, report)
    if not problems:
        return
    if len(problems) == 1:
        raise DatasetError(problems[0].message, **problems[0].where)
    many = f"at least {MOST}" if len(problems) >= MOST else str(len(problems))
    lines = "\n".join(error.message for error in problems)
    raise DatasetError(
        f"{many} problems were found, and nothing was taken:\n{lines}",
        **{**problems[0].where, "problems": len(problems)},
    )


def find_problems(root: Path, report: Report = silent) -> list[PalpateError]:
    """Find the problems of each file by itself, at most MOST.

    The list is empty where the dataset can be opened and every cloud can be read.
    """
    seen = _Found()
    seen.of(lambda: check_folder(root))
    config = seen.of(lambda: stated(root))
    if (root / "touches.csv").exists():
        seen.all(row_problems(root, "touches.csv", TOUCHES, label=0))
    if (root / "traces.csv").exists():
        seen.all(row_problems(root, "traces.csv", TRACES, label=0))
        seen.of(lambda: read_traces(root))
    if config is not None:
        given = config[0]
        seen.of(lambda: read_touches(root, given))
    names = seen.of(lambda: sequence_names(root)) or []
    if config is not None and names:
        given = config[0]
        seen.of(lambda: check_splits(given, names))
    if (root / "rest.ply").exists():
        _cloud(root, "rest.ply", "", config[0] if config else None, seen)
    for number, name in enumerate(names):
        report(number / len(names), f"reading {name}")
        _sequence(root, name, config[0] if config else None, seen)
    if not seen.errors:  # problems between files
        seen.of(lambda: open_dataset(root))
    return seen.errors[:MOST]


def _sequence(root: Path, name: str, config: DatasetConfig | None, seen: _Found) -> None:
    home = f"sequences/{name}"
    seen.all(row_problems(root, f"{home}/kinematics.csv", KINEMATICS))
    at_rest = config is not None and config.synthetic_stamps
    kinematics = seen.of(lambda: read_kinematics(root, f"{home}/kinematics.csv", at_rest))
    forces, clouds = f"{home}/forces.csv", f"{home}/clouds.csv"
    if (root / forces).exists():
        seen.all(row_problems(root, forces, FORCES))
        seen.of(lambda: read_forces(root, forces))
    if not ((root / clouds).exists() or (root / home / "clouds").exists()):
        return
    seen.all(row_problems(root, clouds, CLOUDS, label=1))
    try:
        listed = read_labelled(root, clouds, CLOUDS, label=1)[0]
        files = [file.replace("\\", "/") for file in listed]
    except DatasetError:
        files = []  # listed above
    for file in dict.fromkeys(files):
        if not seen.full and not file.startswith("/") and ".." not in Path(file).parts:
            _cloud(root, f"{home}/{file}", home, config, seen)
    if kinematics is not None:
        clock = kinematics.time
        seen.of(lambda: read_cloud_list(root, home, clouds, clock))


def _cloud(root: Path, file: str, within: str, config: DatasetConfig | None, seen: _Found) -> None:
    points = seen.of(lambda: read_cloud(root, file, within=within))
    if points is not None and config is not None:
        seen.of(lambda: check_span(file, points, config.size))


class _Found:
    """List of problems with each place once."""

    def __init__(self) -> None:
        self.errors: list[PalpateError] = []
        self._places: set[tuple[object, object]] = set()

    @property
    def full(self) -> bool:
        """Whether MOST problems are listed."""
        return len(self.errors) >= MOST

    def of(self, read: Callable[[], T]) -> T | None:
        """Result of `read`; None where it fails, and the error is listed."""
        try:
            return read()
        except PalpateError as error:
            self.all([error])
            return None

    def all(self, errors: list[PalpateError] | list[DatasetError]) -> None:
        """List problems, one for each file and row."""
        for error in errors:
            place = (error.where.get("file"), error.where.get("row", error.where.get("key")))
            if place not in self._places or place == (None, None):
                self._places.add(place)
                self.errors.append(error)
