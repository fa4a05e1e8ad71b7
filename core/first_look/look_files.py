"""Files of a look: look.json, and arrays of clouds, surface and paths beside it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RunError

__all__ = ["LOOK", "LookFiles", "LookPath", "LookSurface", "ShownCloud"]

LOOK = "look.json"
"""File that a look has once it is finished."""
ReasonArray = np.ndarray[Any, np.dtype[np.uint8]]
IntArray = np.ndarray[Any, np.dtype[np.int32]]


@dataclass(frozen=True, eq=False)
class ShownCloud:
    """One stored cloud.

    Attributes:
        points: (n, 3) [m], in the frame that look.json names.
        reason: (n,) index into the reasons of look.json; zeros where nothing was cleaned.
    """

    points: FloatArray
    reason: ReasonArray


@dataclass(frozen=True, eq=False)
class LookSurface:
    """The stated surface, phantom frame: vertices (n, 3) [m], triangles (m, 3)."""

    vertices: FloatArray
    faces: IntArray


@dataclass(frozen=True, eq=False)
class LookPath:
    """Path of the tool in one recording, phantom or robot frame.

    Attributes:
        time: (n,) [s].
        places: (n, 3) tool centres [m].
        axes: (n, 3) unit vectors along the shaft; empty where it is not known.
    """

    time: FloatArray
    places: FloatArray
    axes: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def at(self, time: float) -> FloatArray:
        """The tool's centre (3,) [m] at a time [s]."""
        return np.array([np.interp(time, self.time, self.places[:, axis]) for axis in range(3)])

    def axis_at(self, time: float) -> FloatArray | None:
        """The shaft's direction (3,) next to a time [s]; None where it is not known."""
        row = int(np.abs(self.time - time).argmin())
        return self.axes[row] if len(self.axes) else None


@dataclass(frozen=True)
class LookFiles:
    """The folder of one look."""

    folder: Path

    def write_look(self, look: dict[str, Any]) -> None:
        """Write look.json; numbers must be finite."""
        text = json.dumps(look, ensure_ascii=False, allow_nan=False)
        (self.folder / LOOK).write_text(text, encoding="utf-8")

    def write_cloud(self, recording: int, number: int, cloud: ShownCloud) -> None:
        """Write a cloud by the numbers of its recording and of itself within it."""
        place = self._cloud(recording, number)
        place.parent.mkdir(exist_ok=True)
        np.savez(
            place, points=cloud.points.astype(np.float32), reason=cloud.reason.astype(np.uint8)
        )

    def write_surface(self, vertices: FloatArray, faces: Any) -> None:
        """Write the stated surface."""
        np.savez(
            self.folder / "surface.npz",
            vertices=vertices.astype(np.float32),
            faces=np.asarray(faces, dtype=np.int32),
        )

    def write_path(self, recording: int, path: LookPath) -> None:
        """Write the path of the tool in a recording."""
        place = self.folder / f"path-{recording:03d}.npz"
        np.savez(place, time=path.time, places=path.places, axes=path.axes)

    def look(self) -> dict[str, Any]:
        """Content of look.json; RunError where it cannot be read."""
        try:
            found: dict[str, Any] = json.loads((self.folder / LOOK).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise self._unusable(LOOK, error) from error
        return found

    def cloud(self, recording: int, number: int) -> ShownCloud:
        """One stored cloud; RunError where it is not there."""
        found = self._arrays(self._cloud(recording, number), "points", "reason")
        return ShownCloud(found[0], found[1])

    def surface(self) -> LookSurface | None:
        """The stated surface; None without."""
        place = self.folder / "surface.npz"
        return LookSurface(*self._arrays(place, "vertices", "faces")) if place.exists() else None

    def path(self, recording: int) -> LookPath | None:
        """The path of the tool in a recording; None without."""
        place = self.folder / f"path-{recording:03d}.npz"
        return LookPath(*self._arrays(place, "time", "places", "axes")) if place.exists() else None

    def _cloud(self, recording: int, number: int) -> Path:
        return self.folder / "clouds" / f"{recording:03d}-{number:06d}.npz"

    def _arrays(self, place: Path, *names: str) -> list[Any]:
        try:
            with np.load(place) as file:
                return [file[name] for name in names]
        except (OSError, ValueError, KeyError) as error:
            raise self._unusable(place.name, error) from error

    def _unusable(self, file: str, error: Exception) -> RunError:
        return RunError(
            f"look {self.folder.name}: {file} cannot be read ({error}); make the look again",
            look=self.folder.name,
            file=file,
        )
