"""The error of one setup against the clouds, as sums over each push.

Averages over all pushes, and over bootstrap samples of pushes, are computed from these sums.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.dataset.tool_smoothing import smooth_centres
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import PalpateError, SolveError
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.metrics import paper_distance
from palpate.measurement.patch_averages import patch_means
from palpate.measurement.surface_gaps import gaps
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import replay
from palpate.setup.setup import Setup
from palpate.sweep.sweep_data import SweepSequence

__all__ = ["TOLERANCE", "ReplayResult", "error_from_sums", "replay_errors"]

TOLERANCE = 1e-3
"""Residual over the push force at which a frame counts as converged [1]; equal to the page's."""


@dataclass(frozen=True)
class ReplayResult:
    """The errors of one setup on one sequence.

    Attributes:
        sums: one row per push: squared patch averages times points [m^2], points, sum of the
            paper's distances [m], frames.
        failure: reason why there are no sums; empty where there are.
        lost: whether the process failed rather than the replay, so that the failure says nothing
            about the setup.
    """

    sums: tuple[tuple[float, float, float, float], ...] = ()
    failure: str = ""
    lost: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {"sums": [list(row) for row in self.sums], "failure": self.failure}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> ReplayResult:
        """Return the result that `to_json` wrote."""
        rows = tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in data["sums"])
        return cls(rows, str(data["failure"]))


def error_from_sums(sums: FloatArray, measure: str) -> FloatArray:
    """Return the error (...) [m] of sums (..., 4).

    `measure` is "distance", the RMS of patch averages weighted by points, or "paper", the metric of
    Wu, Kazanzides and Unberath (2020) averaged over frames.
    """
    if measure == "paper":
        return np.asarray(sums[..., 2] / np.maximum(sums[..., 3], 1))
    return np.asarray(np.sqrt(sums[..., 0] / np.maximum(sums[..., 1], 1)))


def replay_errors(setup: Setup, sequence: SweepSequence, grid: Meshing) -> ReplayResult:
    """Replay the frames of one sequence under a setup and compare them with its clouds.

    A replay that fails gives a result with the reason. Only the selected frames are replayed, in
    the order of time, also where frames depend on those before them (`Setup.has_history`).
    """
    try:
        return ReplayResult(_sums(setup, sequence, grid))
    except PalpateError as error:
        return ReplayResult(failure=f"{sequence.name}: {error.message}")
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        return ReplayResult(failure=f"{sequence.name}: {type(error).__name__}: {error}")


def _sums(
    setup: Setup, sequence: SweepSequence, grid: Meshing
) -> tuple[tuple[float, float, float, float], ...]:
    times = sequence.times - setup.sensor.time_offset
    robot = touch_correction(setup, grid) @ setup.phantom_from_robot
    frames = replay(
        setup,
        robot.apply(smooth_centres(sequence.kinematics, times)),
        grid,
        times=times,
        tolerance=TOLERANCE,
    )
    surface, sight = setup.surface(), camera_model_for(setup)
    rows = np.zeros((len(frames), 4))
    for number, (frame, cloud) in enumerate(zip(frames, sequence.clouds, strict=True)):
        if frame.outcome is not Outcome.CONVERGED:
            raise SolveError(
                f"frame {number + 1} of {len(frames)} has no equilibrium: {frame.outcome.value}",
                frame=number,
            )
        points = sight.place(cloud)
        met = gaps(points, sight.pose.translation, frame, surface)
        if len(met.gap) < len(points) / 4:
            raise SolveError(
                f"frame {number + 1}: {len(met.gap)} of {len(points)} points lie near the "
                "simulated surface; expected a quarter",
                frame=number,
            )
        means = patch_means(met.gap, met.patch, surface.patches)
        known = np.isfinite(means.mean)
        count = means.count[known]
        rows[number] = (
            means.mean[known] ** 2 @ count,
            count.sum(),
            paper_distance(points[::2], frame, surface),
            1.0,
        )
    pushes = [
        rows[sequence.probes == probe].sum(axis=0).tolist() for probe in np.unique(sequence.probes)
    ]
    return tuple((a, b, c, d) for a, b, c, d in pushes)
