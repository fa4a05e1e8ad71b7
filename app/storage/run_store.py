"""Results on disk: one folder per finished diagnosis, as the diagnosis wrote it."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from palpate.app.http_errors import Missing
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RunError
from palpate.foundation.frames import Transform

__all__ = ["NAME", "Replay", "Run", "Runs"]

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
FIELDS = (
    *(
        "time",
        "cloud_index",
        "faces",
        "rest",
        "raw",
        "extended",
        "tool_raw",
        "tool_extended",
        "tool_radius_raw",
    ),
    *(
        "tool_radius_extended",
        "error_raw",
        "error_extended",
        "distance_raw",
        "distance_extended",
        "paper_raw",
    ),
    *("paper_extended", "noise_floor", "camera_raw", "camera_extended", "outcome"),
)
CORRECTIONS = "corrections"
"""Folder beside the runs: of each run its recorded frames under a trained network."""
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
class Replay:
    """One sequence as measured and as both models replay it; `arrays` holds what the run folder's
    contract names.
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
        """phantom_from_camera as the `raw` or the `extended` model holds it."""
        return Transform.from_matrix(self.arrays[f"camera_{model}"])


@dataclass(frozen=True)
class Run:
    """One finished diagnosis."""

    path: Path

    @property
    def name(self) -> str:
        """The folder's name, which is the id of the diagnosis."""
        return self.path.name

    @cached_property
    def report(self) -> dict[str, Any]:
        """The report, as in the design's contract."""
        return self._json("report.json")

    @cached_property
    def model(self) -> dict[str, Any]:
        """The extended model with its lineage."""
        return self._json("model.json")

    @cached_property
    def origin(self) -> dict[str, Any]:
        """Where the data lie and when the run was made; empty for a folder that does not say."""
        return self._json("origin.json") if (self.path / "origin.json").is_file() else {}

    @property
    def sequences(self) -> tuple[str, ...]:
        """The names of the replayed sequences, sorted."""
        return tuple(sorted(path.stem for path in (self.path / "replays").glob("*.npz")))

    def replay(self, name: str) -> Replay:
        """The replay of one sequence."""
        if name not in self.sequences:
            known = ", ".join(self.sequences)
            raise Missing(
                f"run {self.name} has no sequence {name}; it has {known}",
                run=self.name,
                sequence=name,
            )
        return Replay(name, self._arrays(f"replays/{name}.npz", FIELDS) | self._corrected(name))

    def stamp(self, name: str) -> tuple[int, ...]:
        """Of the files of a sequence's replay: changes when one of them is written anew."""
        files = (self.path / "replays" / f"{name}.npz", self._correction(name))
        return tuple(file.stat().st_mtime_ns if file.is_file() else 0 for file in files)

    def _correction(self, name: str) -> Path:
        return self.path.parent / CORRECTIONS / self.name / f"{name}.npz"

    def _corrected(self, name: str) -> dict[str, Any]:
        """What a training on this run's model has left of a sequence; nothing where there was none,
        or one of other frames.
        """
        file = self._correction(name)
        return self._arrays(os.path.relpath(file, self.path), CORRECTED) if file.is_file() else {}

    def patterns(self) -> dict[str, Any]:
        """Patch centres and normals (P, 3) and the measured and predicted error (P,) [m], phantom
        frame.
        """
        return self._arrays("patterns.npz", ("centres", "normals", "measured", "predicted"))

    def picture(self, name: str) -> Path:
        """The file of a picture."""
        path = self.path / "pictures" / name
        if not NAME.fullmatch(name) or not path.is_file():
            raise Missing(f"run {self.name} has no picture {name}", run=self.name, picture=name)
        return path

    def _json(self, name: str) -> dict[str, Any]:
        try:
            value = json.loads((self.path / name).read_text())
        except (OSError, ValueError) as error:
            raise self._broken(name, f"cannot be read ({error})") from error
        if not isinstance(value, dict):
            raise self._broken(name, f"holds {type(value).__name__}, expected an object")
        return value

    def _arrays(self, name: str, fields: tuple[str, ...]) -> dict[str, Any]:
        try:
            with (
                (self.path / name).open("rb") as stream,
                np.load(stream, allow_pickle=False) as stored,
            ):
                arrays = {field: stored[field] for field in stored.files}
        except (OSError, ValueError, EOFError, BadZipFile) as error:
            raise self._broken(name, f"cannot be read ({error})") from error
        missing = [field for field in fields if field not in arrays]
        if missing:
            raise self._broken(name, f"lacks {', '.join(missing)}")
        return arrays

    def _broken(self, file: str, what: str) -> RunError:
        return RunError(
            f"run {self.name}: {file} {what}; make the run again", run=self.name, file=file
        )


class Runs:
    """The folder of runs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def all(self) -> list[Run]:
        """All whole runs, the newest first."""
        found = [
            path.parent
            for path in self.folder.glob("*/report.json")
            if NAME.fullmatch(path.parent.name)
        ]
        return [
            Run(path) for path in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)
        ]

    def get(self, name: str) -> Run:
        """One run, or Missing."""
        path = self.folder / name
        if not NAME.fullmatch(name) or not (path / "report.json").is_file():
            raise Missing(f"there is no run {name}; GET /api/runs lists those there are", run=name)
        return Run(path)
