"""Clouds of a look: each point with the reason for which cleaning drops it, thinned for display."""

from __future__ import annotations

from collections.abc import Sequence as Items
from typing import Any

import numpy as np

from palpate.dataset import Sequence
from palpate.first_look.look_files import LookFiles, ShownCloud
from palpate.first_look.staged_dataset import LocatedCamera
from palpate.foundation.progress import Report
from palpate.measurement.segmentation import REASONS
from palpate.measurement.tool_pose import tool_poses

__all__ = ["REASON_ROWS", "write_shown_clouds"]

MOST_POINTS = 8000
"""Points of a stored cloud."""
_STATED = {
    "kept": ("kept as the phantom's", "#e09820"),
    "table": ("on the table", "#8a919c"),
    "tool": ("on the tool, or beside its axis", "#c2410c"),
    "shaft": ("on the tool's shaft", "#7c3aed"),
    "background": ("away from the phantom", "#b4bac2"),
    "stray": ("stray, with hardly a neighbour", "#db2777"),
    "hole": ("at the rim of a hole", "#0891b2"),
    "holder": ("in front of the phantom, on what holds it", "#4d7c0f"),
}
"""Label and colour of each reason."""
REASON_ROWS = [
    {"name": name, "label": _STATED[name][0], "colour": _STATED[name][1]} for name in REASONS
]
"""Rows of look.json, in the order of the numbers that points have."""


def write_shown_clouds(
    files: LookFiles,
    sequences: Items[Sequence],
    numbers: Items[dict[float, int]],
    located: LocatedCamera | None,
    report: Report,
) -> list[dict[str, Any]]:
    """Clean, thin and write the staged clouds of all recordings.

    Args:
        files: of the look.
        sequences: staged, one for each recording.
        numbers: of each recording, number of a cloud by its time [s].
        located: relation to the phantom; None to write the clouds as recorded.
        report: of the progress.

    Returns:
        of each recording `shown`, the numbers of the written clouds, and `counts`, the number of
        points for each reason before thinning; empty where nothing is cleaned.
    """
    total, done = sum(map(len, sequences)) or 1, 0
    rows: list[dict[str, Any]] = []
    for at, (sequence, number) in enumerate(zip(sequences, numbers, strict=True)):
        shown: list[int] = []
        counts: list[list[int]] = []
        for index in range(len(sequence)):
            cloud, count = _cleaned(sequence, index, located)
            key = number[float(sequence.cloud_times[index])]
            files.write_cloud(at, key, cloud)
            shown.append(key)
            counts += [count] if count else []
            done += 1
            report(done / total, f"{sequence.name}: cloud {index + 1} of {len(sequence)} cleaned")
        rows.append({"shown": shown, "counts": counts})
    return rows


def _cleaned(
    sequence: Sequence, index: int, located: LocatedCamera | None
) -> tuple[ShownCloud, list[int]]:
    """One cloud for display, and the number of points for each reason."""
    raw = sequence.cloud(index)
    reason, counts = np.zeros(len(raw), dtype=np.uint8), list[int]()
    if located is not None and located.cleaner is not None:
        tool = None
        if located.robot is not None and len(sequence.kinematics.time):
            times = sequence.cloud_times[index : index + 1]
            (tool,) = tool_poses(sequence.kinematics, times, located.robot, located.shaft)
        cleaned = located.cleaner.clean(raw, tool)
        reason, counts = cleaned.reasons.astype(np.uint8), [cleaned.counts[one] for one in REASONS]
    every = 1 + (len(raw) - 1) // MOST_POINTS if len(raw) else 1
    points = raw[::every] if located is None else located.pose.apply(raw[::every])
    return ShownCloud(points, reason[::every]), counts
