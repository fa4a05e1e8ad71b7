"""Robot data of PokeFlex: a JSON list with a pose and forces for each frame of the cameras."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.stream import Sample, Stream

__all__ = ["FRAME_RATE", "ROBOT_DATA", "RobotFramesSource"]

ROBOT_DATA = "robot_data.json"
FRAME_RATE = 30.0
"""Frames per second [Hz] of the poking recordings; source: Obrist et al. 2024, section on data
acquisition."""


class RobotFramesSource:
    """The pose T_WT of the tool in the world frame [m] and the forces [N], frame by frame.

    Attributes:
        path: of the file.
        warnings: found on reading.
        has_receipt: whether times of receipt are a clock of their own.
        rules: None, as it is no table.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings = [
            f"{path.name}: its times are those of its frames at {FRAME_RATE:g} Hz, as published"
        ]
        self.has_receipt = False
        self.rules: ColumnRules | None = None
        self._frames, self._poses, self._forces = _read(path)

    @staticmethod
    def fits(path: Path) -> bool:
        """Whether a path is such a file, by its name."""
        return path.is_file() and path.name == ROBOT_DATA

    def files(self) -> tuple[Path, ...]:
        """List the file."""
        return (self.path,)

    def close(self) -> None:
        """Do nothing: the file was read at once."""

    def streams(self) -> tuple[Stream, ...]:
        """List the pose and the forces."""
        seconds = float(self._frames[-1] - self._frames[0]) / FRAME_RATE
        return tuple(
            Stream(
                name=f"{ROBOT_DATA}#{kind}",
                kind=kind,
                message_type="frames",
                count=len(self._frames),
                seconds=seconds,
            )
            for kind in ("pose", "wrench")
        )

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the frames in their order."""
        for kind, values in (("pose", self._poses), ("wrench", self._forces)):
            name = f"{ROBOT_DATA}#{kind}"
            for row, frame in enumerate(self._frames if name in names else ()):
                time = round(1e9 * frame / FRAME_RATE)
                yield Sample(
                    stream=name,
                    received=time,
                    stamped=time,
                    frame="",
                    value=partial(values.__getitem__, row),
                )


def _read(path: Path) -> tuple[list[int], FloatArray, FloatArray]:
    """Numbers of the frames, poses (n, 7) [m] and wrenches (n, 6) [N, N m]."""
    try:
        items: Any = json.loads(path.read_text(encoding="utf-8"))
        ordered = sorted(items, key=lambda item: int(item["frame"]))
        frames = [int(item["frame"]) for item in ordered]
        matrices = np.array([item["T_WT"] for item in ordered], dtype=float).reshape(-1, 4, 4)
        forces = np.array([item["forces"][:3] for item in ordered], dtype=float).reshape(-1, 3)
        turns = Rotation.from_matrix(matrices[:, :3, :3]).as_quat()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"{path.name} lacks or misstates {error}; expected a list of frames, each with frame, "
            "forces and T_WT (4 x 4), as PokeFlex has it",
            file=path.name,
        ) from None
    if len(frames) < 2:
        raise DatasetError(
            f"{path.name} has {len(frames)} frames; expected two or more", file=path.name
        )
    poses = np.concatenate([matrices[:, :3, 3], turns], axis=1)
    return frames, poses, np.concatenate([forces, np.zeros_like(forces)], axis=1)
