"""The phantom's points in the depth clouds of a sequence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Sequence
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.frames import Transform
from palpate.foundation.progress import Report, silent
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.tool_pose import ToolShaft, tool_poses

__all__ = ["ObservedClouds", "segment_clouds"]


@dataclass(frozen=True, eq=False)
class ObservedClouds:
    """Segmented clouds of one sequence.

    Attributes:
        sequence: its name.
        index: (f,) number of each cloud in the sequence.
        times: (f,) cloud stamps [s].
        clouds: of each frame the phantom's points (n, 3) [m], camera frame.
    """

    sequence: str
    index: IntArray
    times: FloatArray
    clouds: tuple[FloatArray, ...]


def segment_clouds(
    sequence: Sequence,
    index: IntArray,
    cleaner: Cleaner,
    phantom_from_robot: Transform,
    shaft: ToolShaft | None,
    report: Report = silent,
    keep: Callable[[FloatArray], FloatArray] = np.asarray,
) -> ObservedClouds:
    """Read clouds of a sequence and take table, tool, background and stray points out.

    Args:
        sequence: as opened.
        index: (f,) which clouds.
        cleaner: segmentation of the dataset.
        phantom_from_robot: where the kinematics put the tool.
        shaft: of the tool, in its frame; None if unknown.
        report: progress.
        keep: applied to the points (n, 3) [m] of each cloud, camera frame, e.g. to thin them.
    """
    times = np.asarray(sequence.cloud_times)[index]
    poses = tool_poses(sequence.kinematics, times, phantom_from_robot, shaft)
    clouds = []
    for number, (frame, pose) in enumerate(zip(index, poses, strict=True)):
        report(number / len(index), f"{sequence.name}: cloud {number + 1} of {len(index)}")
        raw = sequence.cloud(int(frame))
        clouds.append(keep(raw[cleaner.clean(raw, pose).indices]))
    return ObservedClouds(sequence.name, index, times, tuple(clouds))
