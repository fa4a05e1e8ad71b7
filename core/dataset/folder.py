"""Dataset folders: opened once and checked, with clouds read on demand; never written to."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from palpate.dataset.accepted_registration import AcceptedRegistration
from palpate.dataset.cloud import read_cloud, read_header
from palpate.dataset.contact_points import Touches, Traces, read_touches, read_traces
from palpate.dataset.files import problem
from palpate.dataset.schema import DatasetConfig, read_config
from palpate.dataset.sequence import Sequence, read_sequence
from palpate.dataset.shape_from_file import read_shape
from palpate.dataset.statements.checked_keys import FILE, nearest
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.setup.setup import Box, Shape

__all__ = [
    "Dataset",
    "check_folder",
    "check_span",
    "check_splits",
    "open_dataset",
    "sequence_names",
    "stated",
]

_BAGS = (".bag", ".db3", ".mcap")
_NOT_SEQUENCES = (".", "@", "#", "$", "__MACOSX")
"""Beginnings of the names of folders that file servers and archivers add."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """One phantom in one setup, with its sequences.

    Attributes:
        path: of the folder.
        config: what dataset.toml states.
        touches: of the landmarks.
        has_rest: whether there is a rest cloud.
        loaded: the sequences, sorted by name.
        geometry: stated geometry of the phantom.
        traces: of the tool over the untouched surface.
        accepted: registration of the camera in place of the automatic one; None without.
    """

    path: Path
    config: DatasetConfig
    touches: Touches
    has_rest: bool
    loaded: tuple[Sequence, ...]
    geometry: Box | Shape
    traces: Traces = field(default_factory=Traces)
    accepted: AcceptedRegistration | None = None

    @property
    def name(self) -> str:
        """The name stated in dataset.toml."""
        return self.config.name

    @cached_property
    def sequences(self) -> tuple[str, ...]:
        """Names of all sequences, sorted."""
        return tuple(sequence.name for sequence in self.loaded)

    @cached_property
    def observed(self) -> bool:
        """Whether any sequence has clouds."""
        return any(len(sequence) for sequence in self.loaded)

    def sequence(self, name: str) -> Sequence:
        """The sequence of this name; DatasetError for an unknown one."""
        for sequence in self.loaded:
            if sequence.name == name:
                return sequence
        raise problem(
            f"sequences/{name}",
            f"there is no such sequence; {nearest(name, self.sequences)}",
            value=name,
        )

    def registered(self, accepted: AcceptedRegistration | None) -> Dataset:
        """The dataset with an accepted registration of the camera; RegistrationError where that
        belongs to another rest cloud.
        """
        if accepted is not None:
            accepted.check(self.path)
        return replace(self, accepted=accepted)

    def rest_cloud(self) -> FloatArray:
        """Read the raw cloud (n, 3) [m], camera frame, of the untouched phantom."""
        points = read_cloud(self.path, "rest.ply")
        self._check_span("rest.ply", points)
        return points

    def validate(self, report: Report = silent) -> None:
        """Read every cloud once; DatasetError for the first broken one."""
        if self.has_rest:
            self.rest_cloud()
        total = sum(len(sequence) for sequence in self.loaded)
        done = 0
        for sequence in self.loaded:
            for index, file in enumerate(sequence.cloud_files):
                report(
                    done / total, f"reading {sequence.name}, cloud {index + 1} of {len(sequence)}"
                )
                self._check_span(file, sequence.cloud(index))
                done += 1
        report(1.0, f"read {total} clouds")

    def _check_span(self, file: str, points: FloatArray) -> None:
        check_span(file, points, self.config.size)


def check_span(file: str, points: FloatArray, size: tuple[float, float, float]) -> None:
    """Reject a cloud (n, 3) [m] that is far smaller than a phantom of `size` [m]."""
    # Measured: 17 times as fast along contiguous axes as over rows of three.
    span, edge = float(np.ptp(np.ascontiguousarray(points.T), axis=1).max()), max(size)
    if len(points) > 1 and span < 0.01 * edge:
        text = (
            f"the cloud spans {span:.3g} m; expected about the phantom, {edge:g} m, or more: "
            "is its unit the metre?"
        )
        raise problem(file, text, value=f"{span:.3g}")


def open_dataset(path: Path | str) -> Dataset:
    """Open a dataset folder and check everything but the points of its clouds.

    The points are checked when they are read, or by `Dataset.validate`. Raises DatasetError.
    """
    root = Path(path)
    check_folder(root)
    config, geometry = stated(root)
    touches, traces = read_touches(root, config), read_traces(root)
    given = config.force_sigma, config.synthetic_stamps
    sequences = tuple(read_sequence(root, name, *given) for name in sequence_names(root))
    check_splits(config, [sequence.name for sequence in sequences])
    observed = any(len(sequence) for sequence in sequences)
    if observed and not config.has_camera:
        raise problem(
            FILE,
            "camera is missing, yet there are clouds; expected this table: add it",
            key="camera",
        )
    if observed and config.synthetic_stamps:
        raise problem(
            FILE,
            'motion.stamps = "synthetic", yet there are clouds; expected measured stamps, since '
            "clouds and tool are compared at the same time: leave this key out, or the clouds",
            key="motion.stamps",
        )
    has_rest = observed or (root / "rest.ply").exists()
    if has_rest:
        read_header(root, "rest.ply")
    return Dataset(root, config, touches, has_rest, sequences, geometry, traces)


def stated(root: Path) -> tuple[DatasetConfig, Box | Shape]:
    """Read dataset.toml and the phantom's geometry."""
    config = read_config(root)
    if config.shape is None:
        return config, Box(size=config.size)
    found = read_shape(root, config.shape)
    return config.in_phantom_frame(found.shape.size, found.phantom_from_file), found.shape


def check_folder(root: Path) -> None:
    """Reject a path that is no readable folder."""
    try:
        if root.is_dir():
            list(root.iterdir())
            return
        reason = "is a file" if root.exists() else "does not exist"
    except (OSError, ValueError) as error:
        reason = f"cannot be opened ({getattr(error, 'strerror', None) or error})"
    raise DatasetError(
        f"{root} {reason}; expected the folder of a dataset, with dataset.toml in it",
        file=str(root),
    )


def sequence_names(root: Path) -> list[str]:
    """List the names of the sequences' folders, sorted."""
    try:
        entries = sorted(
            (entry.name, entry.is_dir())
            for entry in (root / "sequences").iterdir()
            if not entry.name.startswith(_NOT_SEQUENCES)
        )
    except OSError as error:
        text = (
            f"is no folder that can be read ({error.strerror}); expected one folder per "
            "sequence in it: add it"
        )
        raise problem("sequences", text) from None
    for name, _ in entries:
        if name.endswith(_BAGS):
            raise problem(
                f"sequences/{name}",
                "bags are read where dataset.toml has [topics]; expected a folder: add it, or run "
                "palpate import FOLDER --to NEW",
            )
        if not name.isprintable():
            raise problem(
                "sequences",
                f"the name {name!a} cannot be printed; expected letters and digits: rename it",
            )
    names = [name for name, is_folder in entries if is_folder]
    if not names:
        raise problem(
            "sequences",
            "holds no sequence; expected at least one folder with kinematics.csv: add one",
        )
    return names


def check_splits(config: DatasetConfig, names: list[str]) -> None:
    """Reject splits with an unknown sequence."""
    for split in ("train", "validation", "test"):
        for name in getattr(config, split):
            if name not in names:
                raise problem(
                    FILE,
                    f"splits.{split} names '{name}', no sequence here; {nearest(name, names)}",
                    key=f"splits.{split}",
                    value=name,
                )
