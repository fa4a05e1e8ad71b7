"""Forces of a sequence beside its pushes, and how much of them the pushes explain.

A regression of the force on Hertz' vector d^1.5 n with a free matrix and a free constant explains
the same share of variance in every frame, sign and unit. Its share over time shifts tells another
clock; only then direction and size say anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.consistency.contact_timeline import ContactTimeline
from palpate.dataset import Dataset, Sequence
from palpate.dataset.tool_smoothing import averaged
from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.foundation.frames import Transform

__all__ = ["FeltMotion", "Reading", "readings"]

_STEP = 0.05
"""Time between samples that are compared [s]."""
_FARTHEST = 12.0
"""Largest shift of the clock that is tried [s]."""
_LEAST_PUSHED = 0.6
"""Least share of the push that a shift must leave in the common time [1]."""
_CLEAR = 2e-3
"""Gap from which the sensor reads its bias alone [m]."""
_PAUSE = 1.0
"""Time without a force from which none is known [s]."""
_PRESSED = 5e-4
"""Depth from which a push counts [m]: the accuracy of touches."""


@dataclass(frozen=True, eq=False)
class FeltMotion:
    """A sequence's force beside its pushes, at the steps of the timeline.

    Attributes:
        name: of the sequence.
        timeline: of the tool, phantom frame.
        force: (n, 3) [N], robot frame, without the mean of the clear stretches, or without a
            constant of each push where there are none; NaN beyond the stream and in its pauses.
        turn: (n, 3, 3) robot frame from the tool's frame.
        to_phantom: (3, 3) phantom frame from the robot frame.
    """

    name: str
    timeline: ContactTimeline
    force: FloatArray
    turn: FloatArray
    to_phantom: FloatArray

    @classmethod
    def of(
        cls, dataset: Dataset, sequence: Sequence, phantom_from_robot: Transform
    ) -> FeltMotion | None:
        """The felt motion of a sequence; None without forces."""
        stream, clock = sequence.forces, sequence.kinematics
        if stream is None:
            return None
        timeline = ContactTimeline.of(dataset, sequence, phantom_from_robot)
        known = (timeline.time >= stream.time[0]) & (timeline.time <= stream.time[-1])
        known &= _is_near(stream.time, timeline.time)
        force = np.where(known[:, None], averaged(stream.time, stream.force, timeline.time), np.nan)
        clear = known & (timeline.gap > _CLEAR)
        if clear.sum() > 4:
            force = force - force[clear].mean(axis=0)
        else:
            force = force - _constants(timeline, force)
        rows = np.clip(np.searchsorted(clock.time, timeline.time), 0, len(clock.time) - 1)
        turn = Rotation.from_quat(clock.quaternion[rows]).as_matrix()
        return cls(sequence.name, timeline, force, turn, phantom_from_robot.rotation)

    @property
    def covered(self) -> float:
        """Share of the time in contact during which the force is known [1]; 1 without contact."""
        pressed = self.timeline.depth > _PRESSED
        return float(np.isfinite(self.force[pressed, 0]).mean()) if pressed.any() else 1.0

    @property
    def pressed(self) -> IntArray:
        """Rows in contact whose force is known."""
        return np.flatnonzero(
            (self.timeline.depth > _PRESSED) & np.isfinite(self.force).all(axis=1)
        )

    def follows(self) -> tuple[float, float, float]:
        """Share of the force's variance that the pushes explain in any frame and unit: as stamped,
        at the best shift of the clock, and that shift [s], positive where the force is late.
        """
        time, push = self.timeline.time, self.timeline.push
        shifts = np.arange(0.0, min(_FARTHEST, 0.8 * (time[-1] - time[0])), _STEP)
        shares = {float(s): self._share(push, float(s)) for s in np.concatenate([shifts, -shifts])}
        best = max(shares.values())
        shift = min((s for s, share in shares.items() if share > best - 0.02), key=abs)
        return shares[0.0], best, shift

    def _share(self, push: FloatArray, shift: float) -> float:
        """Share of variance explained where the force is `shift` [s] late; 0 where too little of
        the push is left.
        """
        time = self.timeline.time
        known = np.isfinite(self.force[:, 0])
        if known.sum() < 8:
            return 0.0
        force = self.force[known]
        at = time[known] - shift
        inside = (at >= time[0]) & (at <= time[-1])
        moved = np.stack([np.interp(at, time, push[:, axis]) for axis in range(3)], axis=-1)
        if inside.sum() < 8 or (moved[inside] ** 2).sum() < _LEAST_PUSHED * (push**2).sum():
            return 0.0
        moved, force = moved[inside], force[inside]
        force = force - force.mean(axis=0)
        whole = float((force**2).sum())
        left = moved - moved.mean(axis=0)
        scale = max(float(np.sqrt((left**2).sum())), 1e-30)
        fit, *_ = np.linalg.lstsq(left / scale, force, rcond=1e-6)
        return 1.0 - float(((force - left / scale @ fit) ** 2).sum()) / whole if whole else 0.0

    def along_normal(self, reading: Reading | None = None) -> tuple[float, float]:
        """Sum of the pressed force along the outward normal, weighted by its length, and sum of
        its squared length [N^2], as read in another way.
        """
        rows = self.pressed
        force = self.force[rows]
        if reading is not None:
            force = reading.apply(force, self.turn[rows])
        along = np.einsum("ni,ni->n", force @ self.to_phantom.T, self.timeline.normal[rows])
        length = np.linalg.norm(force, axis=1)
        return float(along @ length), float(length @ length)

    def hertz(self, radius: float, poisson_ratio: float) -> float:
        """Young's modulus [Pa] by which Hertz' law for a half-space gives the length of the pressed
        forces.
        """
        rows = self.pressed
        push = self.timeline.depth[rows] ** 1.5
        slope = float(np.linalg.norm(self.force[rows], axis=1) @ push / max(push @ push, 1e-30))
        return float(0.75 * slope * (1 - poisson_ratio**2) / np.sqrt(radius))


def _is_near(stamps: FloatArray, times: FloatArray) -> BoolArray:
    """Whether times (n,) [s] lie between two stamps that are no pause apart."""
    steps = np.diff(stamps, append=stamps[-1])
    row = np.clip(np.searchsorted(stamps, times, side="right") - 1, 0, len(stamps) - 1)
    return np.asarray(steps[row] <= max(_PAUSE, 3 * float(np.median(steps))))


def _constants(timeline: ContactTimeline, force: FloatArray) -> FloatArray:
    """Constants (n, 3) [N] of the pushes, by the force's course with depth to the power of 1.5."""
    found = np.zeros_like(force)
    usable = (timeline.depth > 0) & np.isfinite(force[:, 0])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], usable.astype(int), [0]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        course = timeline.depth[start:stop] ** 1.5
        if stop - start > 3 and np.ptp(timeline.depth[start:stop]) > _PRESSED:
            rows = np.stack([np.ones(stop - start), course / course.max()], axis=-1)
            found[start:stop] = np.linalg.lstsq(rows, force[start:stop], rcond=None)[0][0]
    return found


@dataclass(frozen=True, eq=False)
class Reading:
    """Another way to read the columns of the forces.

    Attributes:
        words: for a person.
        axes: (3, 3) signed permutation of the columns.
        of_tool: whether they are in the tool's frame.
    """

    words: str
    axes: FloatArray
    of_tool: bool = False

    def apply(self, force: FloatArray, turn: FloatArray) -> FloatArray:
        """Forces (n, 3) as read so, with the tool's rotations (n, 3, 3)."""
        read = force @ self.axes.T
        return np.einsum("nij,nj->ni", turn, read) if self.of_tool else read


def readings() -> list[Reading]:
    """Other ways to read the columns, the likelier ones first."""
    eye = np.eye(3)
    found = [Reading("with the opposite sign", -eye)]
    for axis, letter in enumerate("xyz"):
        flip = eye.copy()
        flip[axis, axis] = -1
        found.append(Reading(f"with the sign of f{letter} reversed", flip))
    found += [
        Reading("in the tool's frame", eye, True),
        Reading("in the tool's frame and with the opposite sign", -eye, True),
    ]
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            axes = np.array(signs)[:, None] * eye[list(order)]
            names = ", ".join(
                ("-" if sign < 0 else "") + "f" + "xyz"[axis]
                for sign, axis in zip(signs, order, strict=True)
            )
            found.append(Reading(f"as {names} in place of fx, fy, fz", axes))
    return found
