"""Time of comparing clouds of 45 000 points with a replayed frame."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from benchmarks.cpu_time import timed
from benchmarks.reference_pokes import SETUP
from palpate.measurement.patch_averages import patch_means
from palpate.measurement.surface_gaps import gaps
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay

__all__ = ["run"]

POINTS, ROUNDS = 45_000, 10
OFFSET, SIGMA = 3e-4, 1e-3


def run() -> list[Table]:
    """Measure a known offset under noise along the rays; RuntimeError where it is wrong."""
    x, y, z = SETUP.geometry.size
    centres = np.array([[0.0, 0.0, z + 5e-3 - depth] for depth in (2e-3, 4e-3)])
    frame = replay(SETUP, centres, GridSpec(nodes=(11, 9, 7), spacing=1.5e-3))[-1]
    surface, camera, rng = (
        SETUP.surface(),
        np.array([0.02, -0.05, 0.35]),
        np.random.default_rng(0),
    )
    rest = rng.uniform([-x / 2, -y / 2, z], [x / 2, y / 2, z], (POINTS, 3))
    points = frame.move(rest) + np.array([0.0, 0.0, OFFSET])
    rays = points - camera
    points = (
        points
        + rays / np.linalg.norm(rays, axis=1)[:, None] * rng.normal(0, SIGMA, POINTS)[:, None]
    )
    gaps(points, camera, frame, surface)  # warm-up: loads Open3D
    measured, casting = timed(
        lambda: [gaps(points, camera, frame, surface) for _ in range(ROUNDS)][-1]
    )
    means, averaging = timed(
        lambda: [patch_means(measured.gap, measured.patch, surface.patches) for _ in range(ROUNDS)][
            -1
        ]
    )
    error = float(np.nanmedian(means.mean)) - OFFSET
    if abs(error) > 3e-5:
        raise RuntimeError(
            f"an offset of {OFFSET * 1e3:.2f} mm was measured with an error of {error * 1e3:.3f} mm"
        )
    table = Table("step", "points", "ms a cloud", title="Measurement, one thread")
    table.add_row("gaps along the rays", str(POINTS), f"{1e3 * casting / ROUNDS:.1f}")
    table.add_row("means of patches", str(len(measured.gap)), f"{1e3 * averaging / ROUNDS:.1f}")
    return [table]
