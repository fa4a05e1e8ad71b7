"""Depth images of PokeFlex: a folder of one camera with its parameters beside the images."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.messages.depth_messages import depth_from_png
from palpate.importing.messages.pinhole_camera import PinholeCamera
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.robot_frames_source import FRAME_RATE
from palpate.importing.stream import Sample, Stream

__all__ = ["CAMERA_FILE", "DepthFramesSource", "camera_numbers"]

CAMERA_FILE = "camera_parameters.json"


class DepthFramesSource:
    """A folder depth/ of PNG images [mm], the first of which is frame 1, beside
    camera_parameters.json.

    Attributes:
        path: of the folder of the camera.
        warnings: found on reading.
        has_receipt: whether times of receipt are a clock of their own.
        rules: None, as it is no table.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []
        self.has_receipt = False
        self.rules: ColumnRules | None = None
        self._images = sorted((path / "depth").glob("*.png"))
        self._matrix = camera_numbers(path, "depth_intrinsics", (3, 3))
        self._bent = camera_numbers(path, "depth_dist_coeffs", None).ravel()[:8]

    @staticmethod
    def fits(path: Path) -> bool:
        """Whether a path is such a folder."""
        return (path / CAMERA_FILE).is_file() and any((path / "depth").glob("*.png"))

    def files(self) -> tuple[Path, ...]:
        """List the parameters and the images in order."""
        return (self.path / CAMERA_FILE, *self._images)

    def close(self) -> None:
        """Do nothing: files are opened one by one."""

    def streams(self) -> tuple[Stream, ...]:
        """List the one stream of clouds."""
        count = len(self._images)
        name, seconds = f"camera#{self.path.name}", (count - 1) / FRAME_RATE
        return (
            Stream(
                name=name, kind="cloud", message_type="depth images", count=count, seconds=seconds
            ),
        )

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the images in order."""
        name = f"camera#{self.path.name}"
        for number, file in enumerate(self._images if name in names else (), 1):
            time = round(1e9 * number / FRAME_RATE)
            yield Sample(
                stream=name,
                received=time,
                stamped=time,
                frame="",
                value=partial(self._points, file),
            )

    def _points(self, file: Path) -> FloatArray:
        depth = depth_from_png(file.read_bytes())
        size = (depth.shape[0], depth.shape[1])
        return PinholeCamera.from_numbers(size, self._matrix, self._bent).points(depth)


def camera_numbers(folder: Path, key: str, shape: tuple[int, ...] | None) -> FloatArray:
    """Numbers of camera_parameters.json by key; DatasetError where they are not of this shape."""
    try:
        stated = np.array(json.loads((folder / CAMERA_FILE).read_text())[key], dtype=float)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"{folder.name}/{CAMERA_FILE} lacks or misstates {error}; expected {key}",
            file=CAMERA_FILE,
            key=key,
        ) from None
    if shape is not None and stated.shape != shape:
        raise DatasetError(
            f"{folder.name}/{CAMERA_FILE}: {key} has the shape {stated.shape}; expected {shape}",
            file=CAMERA_FILE,
            key=key,
        )
    return stated
