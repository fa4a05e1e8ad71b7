"""Runs on disk: a folder for each finished diagnosis, as the diagnosis wrote it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from palpate.app.http_errors import Missing
from palpate.app.storage.result_store import NAME, ResultStore, read_object, unusable
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["CORRECTIONS", "EXPORTS", "RecordedReplay", "Run", "RunStore"]

FIELDS = (
    "time",
    "cloud_index",
    "faces",
    "rest",
    "raw",
    "extended",
    "tool_raw",
    "tool_extended",
    "tool_radius_raw",
    "tool_radius_extended",
    "error_raw",
    "error_extended",
    "distance_raw",
    "distance_extended",
    "paper_raw",
    "paper_extended",
    "noise_floor",
    "camera_raw",
    "camera_extended",
    "outcome",
)
"""Arrays that every file of a replay has."""
CORRECTIONS = "corrections"
"""Folder beside the runs: the recorded frames of each run, corrected by a trained network."""
EXPORTS = "exports"
"""Folder beside the runs in which exported files lie, a folder for each job."""
CORRECTED = (
    "corrected",
    "error_corrected",
    "distance_corrected",
    "paper_corrected",
    "tool_corrected",
    "tool_radius_corrected",
    "camera_corrected",
)


@dataclass(frozen=True, eq=False)
class RecordedReplay:
    """One sequence as recorded in a run: the measurement and the replays of the models.

    Attributes:
        name: of the sequence.
        arrays: at least those of FIELDS.
    """

    name: str
    arrays: dict[str, Any]

    def __getitem__(self, key: str) -> Any:
        return self.arrays[key]

    def __len__(self) -> int:
        return len(self.arrays["time"])

    @property
    def size(self) -> FloatArray:
        """(3,) edge lengths of the phantom's bounding box [m]."""
        rest = self.arrays["rest"]
        return np.asarray(rest.max(axis=0) - rest.min(axis=0), dtype=float)

    def camera(self, model: str) -> Transform:
        """phantom_from_camera of the `raw` or the `extended` model."""
        return Transform.from_matrix(self.arrays[f"camera_{model}"])


@dataclass(frozen=True)
class Run:
    """One finished diagnosis."""

    path: Path

    @property
    def name(self) -> str:
        """Name of the folder, which is the id of the diagnosis."""
        return self.path.name

    @cached_property
    def report(self) -> dict[str, Any]:
        """Content of report.json."""
        return self._json("report.json")

    @cached_property
    def model(self) -> dict[str, Any]:
        """Content of model.json: the extended model and how it was found."""
        return self._json("model.json")

    @cached_property
    def origin(self) -> dict[str, Any]:
        """Dataset folder, time and seed of the run; empty where the run does not state them."""
        return self._json("origin.json") if (self.path / "origin.json").is_file() else {}

    @property
    def sequences(self) -> tuple[str, ...]:
        """Names of the replayed sequences, sorted."""
        return tuple(sorted(path.stem for path in (self.path / "replays").glob("*.npz")))

    def replay(self, name: str) -> RecordedReplay:
        """The replay of one sequence; raises Missing for another name."""
        if name not in self.sequences:
            known = ", ".join(self.sequences)
            raise Missing(
                f"run {self.name} has no sequence {name}; it has {known}",
                run=self.name,
                sequence=name,
            )
        return RecordedReplay(
            name, self._arrays(f"replays/{name}.npz", FIELDS) | self._corrected(name)
        )

    def stamp(self, name: str) -> tuple[int, ...]:
        """Modification times of the files of a sequence's replay, for use as a cache key."""
        files = (self.path / "replays" / f"{name}.npz", self._correction(name))
        return tuple(file.stat().st_mtime_ns if file.is_file() else 0 for file in files)

    def _correction(self, name: str) -> Path:
        return self.path.parent / CORRECTIONS / self.name / f"{name}.npz"

    def _corrected(self, name: str) -> dict[str, Any]:
        """Arrays of the corrected model; empty where they were not recorded."""
        file = self._correction(name)
        return self._arrays(os.path.relpath(file, self.path), CORRECTED) if file.is_file() else {}

    def patterns(self) -> dict[str, Any]:
        """Patch centres [m] and normals, (P, 3) in the phantom frame, and the measured and
        predicted error (P,) [m].
        """
        return self._arrays("patterns.npz", ("centres", "normals", "measured", "predicted"))

    def picture(self, name: str) -> Path:
        """Path of a picture; raises Missing where there is none of this name."""
        path = self.path / "pictures" / name
        if not NAME.fullmatch(name) or not path.is_file():
            raise Missing(f"run {self.name} has no picture {name}", run=self.name, picture=name)
        return path

    def _json(self, file: str) -> dict[str, Any]:
        return read_object(self.path / file, "run", self.name)

    def _arrays(self, name: str, fields: tuple[str, ...]) -> dict[str, Any]:
        try:
            with (
                (self.path / name).open("rb") as stream,
                np.load(stream, allow_pickle=False) as stored,
            ):
                arrays = {field: stored[field] for field in stored.files}
        except (OSError, ValueError, EOFError, BadZipFile) as error:
            raise unusable(name, f"cannot be read ({error})", "run", self.name) from error
        missing = [field for field in fields if field not in arrays]
        if missing:
            raise unusable(name, f"lacks {', '.join(missing)}", "run", self.name)
        return arrays


class RunStore(ResultStore):
    """The folder of runs."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "run", "report.json", "report.json")

    def folders(self, name: str) -> list[Path]:
        """Folders of a run: its own, and that of its corrected frames."""
        return [self.folder / name, self.folder / CORRECTIONS / name]

    def all(self) -> list[Run]:
        """All complete runs, the newest first."""
        return [Run(self.folder / name) for name in self.names()]

    def get(self, name: str) -> Run:
        """One run; raises Missing where there is none of this name."""
        if not self.has_begun(name):
            raise self.missing(name)
        return Run(self.folder / name)
