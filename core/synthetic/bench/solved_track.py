"""The true motion of block and tool during one sequence, interpolated between solved key frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush
from palpate.synthetic.solver.tet_block import IntArray

__all__ = ["KeyFrame", "PathSegment", "SolvedPush", "SolvedTrack"]


@dataclass(frozen=True)
class KeyFrame:
    """One solved instant of a motion.

    Attributes:
        surface: (s, 3) displacement of the drawn surface from the stated shape, slip included [m].
        slip: (2,) of the base in the plane [m].
        tool_force: (3,) force of the tool on the block [N].
        penetration: the deepest surface point inside the tool [m].
        deflection: (3,) of the tool's centre under load [m].
    """

    surface: FloatArray
    slip: FloatArray
    tool_force: FloatArray
    penetration: float
    deflection: FloatArray


@dataclass(frozen=True)
class PathSegment:
    """One straight part of a push.

    Attributes:
        begin: time [s].
        end: time [s].
        arcs: increasing arc lengths of the key frames [m]; times [s] where `timed`.
        key_frames: one for each of `arcs`.
        timed: whether the tool stands still while the block changes.
    """

    begin: float
    end: float
    arcs: FloatArray
    key_frames: tuple[KeyFrame, ...]
    timed: bool = False

    def keys(self, push: PlannedPush, times: FloatArray) -> FloatArray:
        """Interpolation coordinates (n,) at times (n,) [s]: arc lengths [m], or times [s]."""
        return times if self.timed else push.arc(times)

    def key(self, push: PlannedPush, time: float) -> float:
        """Interpolation coordinate at one time [s]."""
        return float(self.keys(push, np.array([time]))[0])

    @cached_property
    def _between(self) -> Any:
        return PchipInterpolator(
            self.arcs, np.stack([key_frame.surface for key_frame in self.key_frames])
        )

    @cached_property
    def _force_between(self) -> Any:
        return PchipInterpolator(
            self.arcs, np.stack([key_frame.tool_force for key_frame in self.key_frames])
        )

    @cached_property
    def _way(self) -> Any:
        return PchipInterpolator(
            self.arcs, np.stack([key_frame.deflection for key_frame in self.key_frames])
        )

    def surface(self, arc: float) -> FloatArray:
        """Displacement (s, 3) [m] at a coordinate, by monotone cubics between key frames."""
        return np.asarray(self._between(np.clip(arc, self.arcs[0], self.arcs[-1])))

    def deflection(self, arc: float) -> FloatArray:
        """Deflection (3,) [m] of the tool's centre under load at a coordinate."""
        return np.asarray(self._way(np.clip(arc, self.arcs[0], self.arcs[-1])))

    def tool_force(self, arcs: FloatArray) -> FloatArray:
        """Force of the tool on the block (n, 3) [N] at coordinates (n,)."""
        return np.asarray(self._force_between(np.clip(arcs, self.arcs[0], self.arcs[-1])))


@dataclass(frozen=True)
class SolvedPush:
    """One solved push.

    Attributes:
        push: as it was carried out.
        rest: (s, 3) drawn surface of the stated shape [m].
        faces: (t, 3) triangles.
        settled: (s, 3) displacement before the push, slip included [m].
        segments: in order of time.
        meshed: the pushes for which the mesh is fine.
        creep: (3,) velocity of the block before the push [m/s].
    """

    push: PlannedPush
    rest: FloatArray
    faces: IntArray
    settled: FloatArray
    segments: tuple[PathSegment, ...]
    meshed: tuple[PlannedPush, ...]
    creep: FloatArray = field(default_factory=lambda: np.zeros(3))

    def displacement(self, time: float) -> FloatArray:
        """Displacement (s, 3) from the stated shape [m] at a time [s]."""
        last = self.settled
        for segment in self.segments:
            if time < segment.begin:
                return (
                    last + (time - self.segments[0].begin) * self.creep
                    if segment is self.segments[0]
                    else last
                )
            instant = min(time, segment.end)
            last = segment.surface(segment.key(self.push, instant))
            if time < segment.end:
                return last
        return last

    def deflection(self, time: float) -> FloatArray:
        """Deflection (3,) [m] of the tool's centre under load at a time [s]."""
        for segment in self.segments:
            if segment.begin <= time <= segment.end:
                return segment.deflection(segment.key(self.push, time))
        ended = [segment for segment in self.segments if segment.end < time]
        return (
            ended[-1].deflection(ended[-1].key(self.push, ended[-1].end)) if ended else np.zeros(3)
        )

    def tool_force(self, times: FloatArray) -> FloatArray:
        """Force of the tool on the block (n, 3) [N] at times (n,) [s].

        While the tool stands still between two segments, the force is that at the end of the first.
        """
        found = np.zeros((len(times), 3))
        for segment in self.segments:
            begun = times >= segment.begin
            found[begun] = segment.tool_force(
                segment.keys(self.push, np.minimum(times[begun], segment.end))
            )
        return found

    @property
    def deepest(self) -> list[float]:
        """Two instants [s] of a deep push: at 85 % of the first segment, and half way through."""
        first = self.segments[0]
        way = np.linspace(first.begin, first.end, 200)
        arcs = self.push.arc(way)
        return [
            float(way[np.argmax(arcs > 0.85 * arcs.max())]),
            float(self.push.times[0] + self.push.times[-1]) / 2,
        ]


@dataclass(frozen=True)
class SolvedTrack:
    """All solved pushes of one motion.

    Attributes:
        motion: as it was carried out.
        solved_pushes: one for each push.
    """

    motion: MotionPlan
    solved_pushes: tuple[SolvedPush, ...]

    def at(self, time: float) -> SolvedPush:
        """The push that has begun last at a time [s]."""
        begun = [solved for solved in self.solved_pushes if solved.push.times[0] <= time]
        return begun[-1] if begun else self.solved_pushes[0]

    def surface(self, time: float) -> tuple[FloatArray, IntArray]:
        """The drawn surface at a time [s]: vertices (s, 3) [m] and triangles (t, 3)."""
        solved = self.at(time)
        return solved.rest + solved.displacement(time), solved.faces

    def tool_force(self, times: FloatArray) -> FloatArray:
        """Force of the tool on the block (n, 3) [N] at times (n,) [s]."""
        found = np.zeros((len(times), 3))
        for solved in self.solved_pushes:
            begun = times >= solved.push.times[0]
            found[begun] = solved.tool_force(times[begun])
        return found

    @property
    def slid(self) -> tuple[float, float]:
        """Slip of the base (x, y) [m] at the end of the motion."""
        x, y = self.key_frames[-1].slip
        return float(x), float(y)

    @property
    def key_frames(self) -> list[KeyFrame]:
        """All key frames."""
        return [
            key_frame
            for solved in self.solved_pushes
            for segment in solved.segments
            for key_frame in segment.key_frames
        ]

    @property
    def hardest(self) -> SolvedPush:
        """The push with the largest force."""
        return max(
            self.solved_pushes,
            key=lambda solved: float(np.linalg.norm(solved.segments[0].key_frames[-1].tool_force)),
        )
