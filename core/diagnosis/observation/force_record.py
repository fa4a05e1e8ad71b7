"""Forces as one more measurement: what the sensor in the tool says without its bias, and what a
model makes of it.

A force sensor is off by a bias that wanders. While the tool is clear of the block it shows nothing
else; in between the bias is taken to lie on the straight way, and may have strayed from it as a
random walk does, whose rate the untouched stretches show. How well the engine knows a force is
stated beside that: each push by a common factor, each place by a little of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.dataset import Forces
from palpate.dataset.tool_smoothing import SMOOTHING, averaged
from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.replay.replay import Equilibrium

__all__ = [
    "ForceComparison",
    "ForceRecord",
    "depth_discrepancy",
    "force_discrepancy",
    "force_scatter",
    "rms_force",
]


BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class ForceRecord:
    """The forces of one sequence, robot frame, and how well they are known.

    Attributes:
        time: (n,) [s].
        force: (n, 3) on the tool, its bias taken off [N].
        white: variance of an average over the usual time [N^2].
        strayed: (n,) variance of the bias about what was taken off [N^2].
    """

    time: FloatArray
    force: FloatArray
    white: float
    strayed: FloatArray

    @classmethod
    def of(cls, forces: Forces, untouched: BoolArray) -> ForceRecord | None:
        """From a stream and at which of its stamps (n,) the tool is surely clear; None where it
        hardly ever is.
        """
        time, force = forces.time, forces.force
        centre, mean, count = _readings(time, force, untouched)
        if not len(centre):
            return None
        bias = np.stack([np.interp(time, centre, mean[:, axis]) for axis in range(3)], axis=-1)
        free = force - bias
        sample = float(free[untouched].var())
        rate = _wandering(centre, mean, sample / count)
        return cls(
            time,
            free,
            _white(time, free, untouched, sample),
            _strayed(time, centre, rate, sample / count),
        )

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (m, 3) [N] at times (m,) [s], averaged as the tool's place is, and the bias's
        variance (m,) [N^2].

        NaN beyond the stream.
        """
        known = (times >= self.time[0]) & (times <= self.time[-1])
        force = np.where(known[:, None], averaged(self.time, self.force, times), np.nan)
        return force, np.interp(times, self.time, self.strayed)


def _readings(
    time: FloatArray, force: FloatArray, untouched: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time (c,) [s] and mean (c, 3) [N] of each untouched stretch, none longer than _CELL, and its
    samples (c,).
    """
    run = np.cumsum(np.diff(untouched.astype(int), prepend=0) == 1)
    start = np.full(run.max() + 1, time[0])
    start[run[::-1]] = time[::-1]
    cell = np.stack([run, (time - start[run]) // CRITERIA.force_error.bias_interval], axis=1)[
        untouched
    ]
    _, index, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    sums = [
        np.bincount(index.ravel(), weights=values, minlength=len(count))
        for values in (time[untouched], *force[untouched].T)
    ]
    means, enough = (
        np.stack(sums, axis=-1) / np.maximum(count, 1)[:, None],
        count >= CRITERIA.force_error.least_samples,
    )
    return means[enough, 0], means[enough, 1:], count[enough].astype(float)


def _wandering(centre: FloatArray, mean: FloatArray, variance: FloatArray) -> float:
    """Rate [N^2/s] of the random walk that the readings' differences show beyond their noise."""
    if len(centre) < 2:
        return 0.0
    beyond = (np.diff(mean, axis=0) ** 2).mean(axis=1) - variance[1:] - variance[:-1]
    return max(float(beyond.sum() / np.diff(centre).sum()), 0.0)


def _strayed(time: FloatArray, centre: FloatArray, rate: float, variance: FloatArray) -> FloatArray:
    """Variance (n,) [N^2] of a bridge of the random walk between readings, and of these."""
    after = np.clip(np.searchsorted(centre, time), 0, len(centre) - 1)
    before = np.where(time < centre[after], np.maximum(after - 1, 0), after)
    back, ahead = np.abs(time - centre[before]), np.abs(centre[after] - time)
    bridge = np.where(before == after, back, back * ahead / np.maximum(back + ahead, 1e-9))
    return np.asarray(rate * bridge + np.interp(time, centre, variance))


def _white(time: FloatArray, force: FloatArray, untouched: BoolArray, sample: float) -> float:
    """Variance [N^2] of averages over the usual time, from whole windows of it in which nothing was
    touched.
    """
    step = float(np.median(np.diff(time)))
    width = max(round(2 * SMOOTHING / step), 1)
    whole = len(time) // width * width
    clear = untouched[:whole].reshape(-1, width).all(axis=1)
    windows = force[:whole].reshape(-1, width, 3).mean(axis=1)[clear]
    return (
        float(np.mean(windows**2))
        if len(windows) >= CRITERIA.force_error.least_samples
        else sample / width
    )


@dataclass(frozen=True, eq=False)
class ForceComparison:
    """The forces of a sequence's groups under one setup, phantom frame.

    Attributes:
        gap: (g, 3) measured minus simulated force on the tool [N]; NaN where none was measured.
        noise: (g,) its deviation [N].
        force: (g, 3) simulated [N].
        columns: (g, 3, k) change of gap by what the columns of the surface's gap stand for.
        push: (g,) number of each group's push, from 1; None where a push ends with a group that is
            clear.
    """

    gap: FloatArray
    noise: FloatArray
    force: FloatArray
    columns: FloatArray
    push: IntArray | None = None

    @classmethod
    def of(
        cls,
        measured: tuple[FloatArray, FloatArray],
        frames: Sequence[Equilibrium],
        columns: Sequence[Any],
        push: IntArray | None = None,
    ) -> ForceComparison:
        """From forces and their deviations, a model's frames, and the changes (3, k) of each, if
        any.
        """
        force = np.array([frame.force if frame.in_contact else np.zeros(3) for frame in frames])
        stacked: FloatArray = np.stack(columns) if columns else np.zeros((len(frames), 3, 0))
        return cls(measured[0] - force, measured[1], force, stacked, push)

    def of_groups(self, index: list[int]) -> ForceComparison:
        """These groups alone."""
        push = None if self.push is None else self.push[index]
        return ForceComparison(
            self.gap[index], self.noise[index], self.force[index], self.columns[index], push
        )

    def scaled(self, factor: float) -> ForceComparison:
        """Of a body so many times as stiff: a simulated force goes with the modulus."""
        return replace(
            self,
            gap=self.gap + (1 - factor) * self.force,
            force=factor * self.force,
            columns=factor * self.columns,
        )

    def append_columns(self, added: FloatArray) -> ForceComparison:
        """With further columns (g, 3, m) last."""
        return replace(self, columns=np.concatenate([self.columns, added], axis=2))


def force_scatter(forces: ForceComparison) -> FloatArray:
    """Variance (g, 3) [N^2] of each measured force: the sensor's, and the engine's own."""
    engine = CRITERIA.force_error.group_error * np.linalg.norm(forces.force, axis=1)
    return np.repeat((forces.noise**2 + engine**2)[:, None], 3, axis=1)


def force_discrepancy(forces: ForceComparison, frames: Sequence[Equilibrium]) -> FloatArray:
    """Columns (g, 3, pushes) [N] of the engine's own error, one for each push, of unit variance."""
    return np.asarray(
        CRITERIA.force_error.push_error
        * forces.force[:, :, None]
        * _pushes(forces, frames)[:, None, :]
    )


def depth_discrepancy(forces: ForceComparison, frames: Sequence[Equilibrium]) -> FloatArray:
    """Columns (g, 3, pushes) [N] of how deep each push really went, along its force, of unit
    variance.
    """
    along = forces.force / np.maximum(np.linalg.norm(forces.force, axis=1, keepdims=True), 1e-12)
    deeper = np.einsum("gik,gk->gi", forces.columns[..., :3], along)
    return np.asarray(
        CRITERIA.force_error.contact_depth
        * deeper[:, :, None]
        * _pushes(forces, frames)[:, None, :]
    )


def _pushes(forces: ForceComparison, frames: Sequence[Equilibrium]) -> BoolArray:
    """Which groups belong to which push (g, pushes)."""
    touched = np.array([frame.in_contact for frame in frames])
    push = (
        np.cumsum(np.diff(touched.astype(int), prepend=0) == 1)
        if forces.push is None
        else forces.push
    )
    return np.asarray(touched[:, None] & (push[:, None] == np.arange(1, push.max(initial=0) + 1)))


def rms_force(forces: Sequence[tuple[ForceComparison, BoolArray]]) -> tuple[float, float]:
    """RMS length of measured minus simulated force [N] over groups chosen by masks (g,), and that
    of the sensor's noise.
    """
    gaps = np.concatenate([one.gap[chosen] for one, chosen in forces])
    noise = np.concatenate([one.noise[chosen] for one, chosen in forces])
    known = np.isfinite(gaps).all(axis=1)
    if not known.any():
        return 0.0, 0.0
    return float(np.sqrt((gaps[known] ** 2).sum(axis=1).mean())), float(
        np.sqrt(3 * (noise[known] ** 2).mean())
    )
