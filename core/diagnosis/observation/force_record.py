"""Measured forces without the sensor's bias, and their comparison with simulated ones.

The sensor's bias wanders. While the tool is clear of the phantom the sensor reads the bias alone.
In between the bias is interpolated linearly, with the variance of a Brownian bridge whose rate is
estimated from the untouched stretches. Where the tool never is clear, each push has a constant of
its own, which is fitted with it. The deviation that a dataset states for its forces adds to all of
it. The engine's own error of a force is one common factor for
each push, and a smaller independent error for each group.
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
    "constant_discrepancy",
    "depth_discrepancy",
    "force_discrepancy",
    "force_scatter",
    "rms_force",
]


BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class ForceRecord:
    """The forces of one sequence, robot frame, and their variances.

    Attributes:
        time: (n,) [s].
        force: (n, 3) on the tool, without bias [N].
        white: variance of an average over the smoothing time [N^2].
        bias_variance: (n,) variance of the interpolated bias, and of the stated deviation [N^2].
        offset: standard deviation of what is left of each push's own constant [N]; 0 where the
            sensor was read clear of the phantom.
    """

    time: FloatArray
    force: FloatArray
    white: float
    bias_variance: FloatArray
    offset: float = 0.0

    @classmethod
    def of(cls, forces: Forces, untouched: BoolArray) -> ForceRecord | None:
        """Remove the bias of a stream; None if the tool is hardly ever clear.

        Args:
            forces: the stream.
            untouched: (n,) stamps at which the tool is surely clear of the phantom.
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
            _bias_variance(time, centre, rate, sample / count) + forces.sigma**2,
        )

    @classmethod
    def of_pushes(
        cls, forces: Forces, depth: FloatArray, pushes: Sequence[tuple[float, float]]
    ) -> ForceRecord | None:
        """Remove a constant of each push, by the force's course with depth to the power of 1.5.

        Args:
            forces: the stream.
            depth: (n,) overlap of tool and stated phantom at its stamps [m].
            pushes: first and last time in contact of each [s].

        Returns:
            None if no push has forces at enough depths.
        """
        time, criteria = forces.time, CRITERIA.force_error
        fits = []
        for start, end in pushes:
            own = (time >= start) & (time <= end) & (depth > 0)
            if own.sum() >= criteria.least_steps and np.ptp(depth[own]) >= criteria.least_range:
                rows = np.stack([np.ones(int(own.sum())), depth[own] ** 1.5], axis=-1)
                fits.append((0.5 * (start + end), *_constant(rows, forces.force[own])))
        if not fits:
            return None
        middle, constant, size, residual = (np.array(part) for part in zip(*fits, strict=True))
        nearest = np.abs(time[:, None] - middle).argmin(axis=1)
        return cls(
            time,
            forces.force - constant[nearest],
            float(np.median(residual)),
            np.full(len(time), forces.sigma**2),
            criteria.constant_share * float(np.sqrt(np.mean(size**2))),
        )

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Force (m, 3) [N] at times (m,) [s], averaged as the tool's place is, and the bias's
        variance (m,) [N^2]. The force is NaN beyond the stream.
        """
        known = (times >= self.time[0]) & (times <= self.time[-1])
        force = np.where(known[:, None], averaged(self.time, self.force, times), np.nan)
        return force, np.interp(times, self.time, self.bias_variance)


def _constant(rows: FloatArray, force: FloatArray) -> tuple[FloatArray, float, float]:
    """Fit a constant and a slope to forces (n, 3) [N].

    Returns:
        the constant (3,) [N], the largest force beyond it [N], and the variance left [N^2].
    """
    scale = np.array([1.0, float(np.abs(rows[:, 1]).max())])
    fit = np.linalg.lstsq(rows / scale, force, rcond=None)[0]
    left = force - rows / scale @ fit
    largest = float(np.linalg.norm(force - fit[0], axis=1).max())
    return fit[0], largest, float((left**2).sum() / max(3 * (len(force) - 2), 1))


def _readings(
    time: FloatArray, force: FloatArray, untouched: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bias readings: time (c,) [s], mean (c, 3) [N] and number of samples (c,) of each untouched
    stretch, which is cut at the longest interval of a reading.
    """
    run = np.cumsum(np.diff(untouched.astype(int), prepend=0) == 1)
    start = np.full(run.max() + 1, time[0])
    start[run[::-1]] = time[::-1]
    criteria, step = CRITERIA.force_error, float(np.median(np.diff(time)))
    # A slow stream has few samples in any second; their variance is that of fewer.
    usual = int(criteria.bias_interval / step)
    least = min(criteria.least_samples, max(criteria.fewest_samples, usual))
    slow = 1.5 * least * step
    cell = np.stack([run, (time - start[run]) // max(criteria.bias_interval, slow)], axis=1)[
        untouched
    ]
    _, index, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    sums = [
        np.bincount(index.ravel(), weights=values, minlength=len(count))
        for values in (time[untouched], *force[untouched].T)
    ]
    means, enough = (np.stack(sums, axis=-1) / np.maximum(count, 1)[:, None], count >= least)
    return means[enough, 0], means[enough, 1:], count[enough].astype(float)


def _wandering(centre: FloatArray, mean: FloatArray, variance: FloatArray) -> float:
    """Rate [N^2/s] of the bias's random walk, from the readings' differences beyond their noise."""
    if len(centre) < 2:
        return 0.0
    beyond = (np.diff(mean, axis=0) ** 2).mean(axis=1) - variance[1:] - variance[:-1]
    return max(float(beyond.sum() / np.diff(centre).sum()), 0.0)


def _bias_variance(
    time: FloatArray, centre: FloatArray, rate: float, variance: FloatArray
) -> FloatArray:
    """Variance (n,) [N^2] of the Brownian bridge between readings, plus that of the readings."""
    after = np.clip(np.searchsorted(centre, time), 0, len(centre) - 1)
    before = np.where(time < centre[after], np.maximum(after - 1, 0), after)
    back, ahead = np.abs(time - centre[before]), np.abs(centre[after] - time)
    bridge = np.where(before == after, back, back * ahead / np.maximum(back + ahead, 1e-9))
    return np.asarray(rate * bridge + np.interp(time, centre, variance))


def _white(time: FloatArray, force: FloatArray, untouched: BoolArray, sample: float) -> float:
    """Variance [N^2] of averages over the smoothing time, from whole untouched windows."""
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
    """Measured and simulated forces of a sequence's g groups under one setup, phantom frame.

    Attributes:
        gap: (g, 3) measured minus simulated force on the tool [N]; NaN where none was measured.
        noise: (g,) standard deviation of one component of the measured force [N].
        force: (g, 3) simulated [N].
        columns: (g, 3, k) change of gap, with the same columns as the surface's gap.
        push: (g,) number of each group's push, from 1; None if a clear group ends each push.
        offset: standard deviation of each push's own constant [N], which is part of `noise`.
    """

    gap: FloatArray
    noise: FloatArray
    force: FloatArray
    columns: FloatArray
    push: IntArray | None = None
    offset: float = 0.0

    @classmethod
    def of(
        cls,
        measured: tuple[FloatArray, FloatArray],
        frames: Sequence[Equilibrium],
        columns: Sequence[Any],
        push: IntArray | None = None,
        offset: float = 0.0,
    ) -> ForceComparison:
        """Compare forces with a model.

        Args:
            measured: forces (g, 3) and their standard deviations (g,) [N].
            frames: the model's equilibria.
            columns: for each group its changes (3, k); may be empty.
            push: (g,) number of each group's push.
            offset: standard deviation of each push's own constant [N].
        """
        force = np.array([frame.force if frame.in_contact else np.zeros(3) for frame in frames])
        stacked: FloatArray = np.stack(columns) if columns else np.zeros((len(frames), 3, 0))
        return cls(measured[0] - force, measured[1], force, stacked, push, offset)

    def of_groups(self, index: list[int]) -> ForceComparison:
        """Return the comparison of these groups alone."""
        push = None if self.push is None else self.push[index]
        return replace(
            self,
            gap=self.gap[index],
            noise=self.noise[index],
            force=self.force[index],
            columns=self.columns[index],
            push=push,
        )

    def scaled(self, factor: float) -> ForceComparison:
        """Scale the simulated forces, which are proportional to Young's modulus."""
        return replace(
            self,
            gap=self.gap + (1 - factor) * self.force,
            force=factor * self.force,
            columns=factor * self.columns,
        )

    def append_columns(self, added: FloatArray) -> ForceComparison:
        """Append columns (g, 3, m)."""
        return replace(self, columns=np.concatenate([self.columns, added], axis=2))


def force_scatter(forces: ForceComparison) -> FloatArray:
    """Variance (g, 3) [N^2] of each force: the sensor's without the constants of the pushes, and
    the engine's own.
    """
    engine = CRITERIA.force_error.group_error * np.linalg.norm(forces.force, axis=1)
    own = np.maximum(forces.noise**2 - forces.offset**2, 0.0)
    return np.repeat((own + engine**2)[:, None], 3, axis=1)


def constant_discrepancy(forces: ForceComparison, frames: Sequence[Equilibrium]) -> FloatArray:
    """Columns (g, 3, 3 pushes) [N] of each push's own constant, of unit variance; none where the
    sensor's bias is known.
    """
    if not forces.offset:
        return np.zeros((*forces.force.shape, 0))
    own = _pushes(forces, frames).astype(float)
    found = forces.offset * np.einsum("gp,ik->gipk", own, np.eye(3))
    return np.asarray(found.reshape(*forces.force.shape, -1))


def force_discrepancy(forces: ForceComparison, frames: Sequence[Equilibrium]) -> FloatArray:
    """Columns (g, 3, pushes) [N] of the engine's relative error of each push, of unit variance."""
    return np.asarray(
        CRITERIA.force_error.push_error
        * forces.force[:, :, None]
        * _pushes(forces, frames)[:, None, :]
    )


def depth_discrepancy(forces: ForceComparison, frames: Sequence[Equilibrium]) -> FloatArray:
    """Columns (g, 3, pushes) [N] of the error of each push's depth, of unit variance."""
    along = forces.force / np.maximum(np.linalg.norm(forces.force, axis=1, keepdims=True), 1e-12)
    deeper = np.einsum("gik,gk->gi", forces.columns[..., :3], along)
    return np.asarray(
        CRITERIA.force_error.contact_depth
        * deeper[:, :, None]
        * _pushes(forces, frames)[:, None, :]
    )


def _pushes(forces: ForceComparison, frames: Sequence[Equilibrium]) -> BoolArray:
    """Membership (g, pushes) of groups in pushes."""
    touched = np.array([frame.in_contact for frame in frames])
    push = (
        np.cumsum(np.diff(touched.astype(int), prepend=0) == 1)
        if forces.push is None
        else forces.push
    )
    return np.asarray(touched[:, None] & (push[:, None] == np.arange(1, push.max(initial=0) + 1)))


def rms_force(forces: Sequence[tuple[ForceComparison, BoolArray]]) -> tuple[float, float]:
    """RMS length of measured minus simulated force [N] over groups that masks (g,) choose, and RMS
    length of the sensor's noise.
    """
    gaps = np.concatenate([one.gap[chosen] for one, chosen in forces])
    noise = np.concatenate([one.noise[chosen] for one, chosen in forces])
    known = np.isfinite(gaps).all(axis=1)
    if not known.any():
        return 0.0, 0.0
    return float(np.sqrt((gaps[known] ** 2).sum(axis=1).mean())), float(
        np.sqrt(3 * (noise[known] ** 2).mean())
    )
