"""What the block truly does during one motion, at any time between the solved keys."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.motion_plan import Motion, Probe
from palpate.synthetic.solver.tet_block import IntArray

__all__ = ["Moment", "Passage", "Stretch", "Track"]


@dataclass(frozen=True)
class Moment:
    """A key of the motion that was solved.

    Attributes:
        surface: (s, 3) displacement of the drawn surface from the stated shape, slip included [m].
        slip: (2,) of the base in the plane [m].
        push: (3,) force of the tool on the block [N].
        penetration: the deepest surface point inside the tool [m].
        deflection: (3,) of the tool's centre under load [m].
    """

    surface: FloatArray
    slip: FloatArray
    push: FloatArray
    penetration: float
    deflection: FloatArray


@dataclass(frozen=True)
class Passage:
    """One straight run along a probe, from `begin` to `end` [s]: `moments` at growing arc lengths
    `arcs` [m].

    While the tool stands still and the block does not, `arcs` are times [s] instead: the passage is
    `timed`.
    """

    begin: float
    end: float
    arcs: FloatArray
    moments: tuple[Moment, ...]
    timed: bool = False

    def keys(self, probe: Probe, times: FloatArray) -> FloatArray:
        """What stands in the place of arc lengths (n,) at these times (n,) [s] of the probe."""
        return times if self.timed else probe.arc(times)

    def key(self, probe: Probe, time: float) -> float:
        """The same at one time [s]."""
        return float(self.keys(probe, np.array([time]))[0])

    @cached_property
    def _between(self) -> Any:
        return PchipInterpolator(self.arcs, np.stack([moment.surface for moment in self.moments]))

    @cached_property
    def _force(self) -> Any:
        return PchipInterpolator(self.arcs, np.stack([moment.push for moment in self.moments]))

    @cached_property
    def _way(self) -> Any:
        return PchipInterpolator(
            self.arcs, np.stack([moment.deflection for moment in self.moments])
        )

    def surface(self, arc: float) -> FloatArray:
        """Displacement (s, 3) [m] at an arc length [m], by monotone cubics between the keys."""
        return np.asarray(self._between(np.clip(arc, self.arcs[0], self.arcs[-1])))

    def deflection(self, arc: float) -> FloatArray:
        """Of the tool's centre under load (3,) [m] at an arc length [m], likewise."""
        return np.asarray(self._way(np.clip(arc, self.arcs[0], self.arcs[-1])))

    def push(self, arcs: FloatArray) -> FloatArray:
        """Force of the tool on the block (n, 3) [N] at arc lengths (n,) [m], likewise."""
        return np.asarray(self._force(np.clip(arcs, self.arcs[0], self.arcs[-1])))


@dataclass(frozen=True)
class Stretch:
    """One probe, solved on a grid of its own.

    Attributes:
        rest: (s, 3) drawn surface of the stated shape [m].
        faces: (t, 3).
        settled: (s, 3) displacement before the probe, slip included [m].
        meshed: the probes for which the grid is fine.
        creep: (3,) how fast the block moves before the probe [m/s].
    """

    probe: Probe
    rest: FloatArray
    faces: IntArray
    settled: FloatArray
    passages: tuple[Passage, ...]
    meshed: tuple[Probe, ...]
    creep: FloatArray = field(default_factory=lambda: np.zeros(3))

    def displacement(self, time: float) -> FloatArray:
        """Displacement (s, 3) from the stated shape [m] at a time [s]."""
        last = self.settled
        for passage in self.passages:
            if time < passage.begin:
                return (
                    last + (time - self.passages[0].begin) * self.creep
                    if passage is self.passages[0]
                    else last
                )
            instant = min(time, passage.end)
            last = passage.surface(passage.key(self.probe, instant))
            if time < passage.end:
                return last
        return last

    def deflection(self, time: float) -> FloatArray:
        """Of the tool's centre under load (3,) [m] at a time [s]."""
        for passage in self.passages:
            if passage.begin <= time <= passage.end:
                return passage.deflection(passage.key(self.probe, time))
        ended = [passage for passage in self.passages if passage.end < time]
        return (
            ended[-1].deflection(ended[-1].key(self.probe, ended[-1].end)) if ended else np.zeros(3)
        )

    def push(self, times: FloatArray) -> FloatArray:
        """Force of the tool on the block (n, 3) [N] at times (n,) [s]; while it stands between two
        passages, that of the first.
        """
        found = np.zeros((len(times), 3))
        for passage in self.passages:
            begun = times >= passage.begin
            found[begun] = passage.push(
                passage.keys(self.probe, np.minimum(times[begun], passage.end))
            )
        return found

    @property
    def deepest(self) -> list[float]:
        """Two instants [s]: on the way in, and half way through."""
        first = self.passages[0]
        way = np.linspace(first.begin, first.end, 200)
        arcs = self.probe.arc(way)
        return [
            float(way[np.argmax(arcs > 0.85 * arcs.max())]),
            float(self.probe.times[0] + self.probe.times[-1]) / 2,
        ]


@dataclass(frozen=True)
class Track:
    """All probes of one motion, one stretch each."""

    motion: Motion
    stretches: tuple[Stretch, ...]

    def at(self, time: float) -> Stretch:
        """The stretch whose grid holds at a time [s]: the last that has begun."""
        begun = [stretch for stretch in self.stretches if stretch.probe.times[0] <= time]
        return begun[-1] if begun else self.stretches[0]

    def surface(self, time: float) -> tuple[FloatArray, IntArray]:
        """The drawn surface at a time [s]: vertices (s, 3) [m] and triangles (t, 3)."""
        stretch = self.at(time)
        return stretch.rest + stretch.displacement(time), stretch.faces

    def push(self, times: FloatArray) -> FloatArray:
        """Force of the tool on the block (n, 3) [N] at times (n,) [s]."""
        found = np.zeros((len(times), 3))
        for stretch in self.stretches:
            begun = times >= stretch.probe.times[0]
            found[begun] = stretch.push(times[begun])
        return found

    @property
    def slid(self) -> tuple[float, float]:
        """How far the base lies from where it was put as the motion ends [m]."""
        x, y = self.moments[-1].slip
        return float(x), float(y)

    @property
    def moments(self) -> list[Moment]:
        """All solved keys."""
        return [
            moment
            for stretch in self.stretches
            for passage in stretch.passages
            for moment in passage.moments
        ]

    @property
    def hardest(self) -> Stretch:
        """The stretch with the strongest push."""
        return max(
            self.stretches,
            key=lambda stretch: float(np.linalg.norm(stretch.passages[0].moments[-1].push)),
        )
