"""Accuracy and time of segmenting the phantom out of raw clouds."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from benchmarks.cpu_time import timed
from benchmarks.reference_pokes import SETUP
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.tool_pose import ToolPose, ToolShaft

__all__ = ["run"]

POINTS, ROUNDS, SIGMA = 45_000, 10, 5e-4
TOOL = np.array([0.0, 0.0, 0.0358 + 3e-3])
POSE = Transform(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.35]))
"""phantom_from_camera of a camera 35 cm above the block, looking down."""


def _scene(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return a raw cloud (n, 3) [m], camera frame, and which points are phantom (n,)."""
    x, y, z = SETUP.geometry.size
    places = rng.uniform([-0.09, -0.07], [0.09, 0.07], (POINTS, 2))
    on_top = (np.abs(places[:, 0]) < x / 2) & (np.abs(places[:, 1]) < y / 2)
    away = np.hypot(places[:, 0] - TOOL[0], places[:, 1] - TOOL[1])
    on_tool = away < SETUP.tool.radius
    height = np.where(on_top, z, 0.0)
    height[on_tool] = TOOL[2] + np.sqrt(SETUP.tool.radius**2 - away[on_tool] ** 2)
    height += SIGMA * rng.standard_normal(POINTS)
    # Points are placed in the scene, so that depth noise is noise of the height.
    return POSE.inverse().apply(np.column_stack([places, height])), on_top & ~on_tool


def run() -> list[Table]:
    """Segment one cloud repeatedly; RuntimeError where too many points are wrong."""
    cloud, phantom = _scene(np.random.default_rng(1))
    cleaner = Cleaner(
        geometry=SETUP.geometry,
        phantom_from_camera=POSE,
        tool_radius=SETUP.tool.radius,
        noise=SIGMA,
    )
    tool = ToolPose(TOOL, ToolShaft(np.array([0.0, 0.0, 1.0]), 3e-3))
    clean, seconds = timed(lambda: [cleaner.clean(cloud, tool) for _ in range(ROUNDS)][-1])
    selected = np.zeros(len(cloud), dtype=bool)
    selected[clean.indices] = True
    recall, wrong = (
        float((selected & phantom).sum() / phantom.sum()),
        float((selected & np.logical_not(phantom)).sum() / selected.sum()),
    )
    if recall < 0.93 or wrong > 0.01:
        raise RuntimeError(
            f"{recall:.1%} of the phantom's points were kept, and {wrong:.1%} of the kept points "
            "are not phantom"
        )
    table = Table(
        "points", "phantom kept", "others kept", "ms a cloud", title="Segmentation, one thread"
    )
    table.add_row(str(len(cloud)), f"{recall:.1%}", f"{wrong:.2%}", f"{1e3 * seconds / ROUNDS:.1f}")
    return [table]
