"""The error of one setup against the clouds: replay, compare, and keep sums by probe, from which
any average can be drawn again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.dataset.tool_smoothing import smooth_centres
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError, SolveError
from palpate.measurement.camera_model import sight_of
from palpate.measurement.metrics import paper_distance
from palpate.measurement.patch_averages import patch_means
from palpate.measurement.surface_gaps import Surface, gaps
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import replay
from palpate.setup.setup import Setup
from palpate.sweep.sweep_data import SweepSequence

__all__ = ["TOLERANCE", "ReplayResult", "error_from_sums", "replay_errors"]

TOLERANCE = 1e-3
"""Residual at which a frame of a sweep counts as converged, over the push [1]; as in the page's
replays."""


@dataclass(frozen=True)
class ReplayResult:
    """What one setup gave on one sequence, by push of the tool.

    Attributes:
        sums: rows (squared patch averages [m^2] times points, points, sum of the paper's distances
            [m], frames) of each probe.
        failure: why there are none; empty where there are.
        lost: whether that says nothing of the setup, but of its process.
    """

    sums: tuple[tuple[float, float, float, float], ...] = ()
    failure: str = ""
    lost: bool = False

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"sums": [list(row) for row in self.sums], "failure": self.failure}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> ReplayResult:
        """The inverse."""
        rows = tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in data["sums"])
        return cls(rows, str(data["failure"]))


def error_from_sums(sums: FloatArray, measure: str) -> FloatArray:
    """Error [m] from sums (..., 4): RMS of patch averages weighted by points, or the paper's metric
    as a mean over frames.
    """
    if measure == "paper":
        return np.asarray(sums[..., 2] / np.maximum(sums[..., 3], 1))
    return np.asarray(np.sqrt(sums[..., 0] / np.maximum(sums[..., 1], 1)))


def replay_errors(setup: Setup, seen: SweepSequence, grid: Meshing) -> ReplayResult:
    """Replay the frames of one sequence under this setup and compare; what cannot be replayed is a
    failure that says why.

    Of frames that hang on those before them (`Setup.has_history`) only the chosen ones are replayed,
    in the order of time.
    """
    try:
        return ReplayResult(_sums(setup, seen, grid))
    except PalpateError as error:
        return ReplayResult(failure=f"{seen.name}: {error.message}")
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        return ReplayResult(failure=f"{seen.name}: {type(error).__name__}: {error}")


def _sums(
    setup: Setup, seen: SweepSequence, grid: Meshing
) -> tuple[tuple[float, float, float, float], ...]:
    times = seen.times - setup.sensor.time_offset
    robot = touch_correction(setup, grid) @ setup.phantom_from_robot
    frames = replay(
        setup,
        robot.apply(smooth_centres(seen.kinematics, times)),
        grid,
        times=times,
        tolerance=TOLERANCE,
    )
    surface, sight = Surface.of(setup), sight_of(setup)
    rows = np.zeros((len(frames), 4))
    for number, (frame, cloud) in enumerate(zip(frames, seen.clouds, strict=True)):
        if frame.outcome is not Outcome.CONVERGED:
            raise SolveError(
                f"frame {number + 1} of {len(frames)} has no equilibrium: {frame.outcome.value}",
                frame=number,
            )
        points = sight.place(cloud)
        met = gaps(points, sight.pose.translation, frame, surface)
        if len(met.gap) < len(points) / 4:
            text = f"frame {number + 1}: {len(met.gap)} of {len(points)} points lie near the simulated surface; expected a quarter"
            raise SolveError(text, frame=number)
        means = patch_means(met.gap, met.patch, surface.patches)
        known = np.isfinite(means.mean)
        count = means.count[known]
        rows[number] = (
            means.mean[known] ** 2 @ count,
            count.sum(),
            paper_distance(points[::2], frame, surface),
            1.0,
        )
    pushes = [rows[seen.probes == probe].sum(axis=0).tolist() for probe in np.unique(seen.probes)]
    return tuple((a, b, c, d) for a, b, c, d in pushes)
