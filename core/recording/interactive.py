"""A block under a tool that a hand leads: one equilibrium for each place that is asked for, from
the last one on.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.surface_gaps import Surface
from palpate.mesh.protocol import Meshing
from palpate.recording.interior_fields import InteriorFields
from palpate.recording.record_sequence import VERTEX_SPACING
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup

__all__ = ["DEEPEST", "InteractiveFrame", "InteractiveReplay"]

DEEPEST = 0.25
"""Of the block's shortest side, how far a hand may push: beyond, an answer takes longer than a hand
likes to wait."""
_FAR = 0.06
"""Nor is the tool led further from the block than this [m]."""
_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class InteractiveFrame:
    """What the block answers, phantom frame, SI; the arrays are as a recording has them.

    Attributes:
        surface: (v, 3) moved material vertices; those of the last equilibrium where there is none.
        error: (v,) NaN, for nobody measured it.
        tool: (3,) true centre.
        radius: of the tool.
        camera: (4, 4) phantom_from_camera.
        inside: its nodes, as a recording of one frame, where they were asked for.
        depth: how far the tool reaches into the block at rest.
        force: (3,) on the tool.
        converged: whether this is an equilibrium.
        outcome: how the solve ended.
        seconds: that it took.
    """

    surface: FloatArray
    error: FloatArray
    tool: FloatArray
    radius: float
    camera: FloatArray
    inside: InteriorFields | None
    depth: float
    force: FloatArray
    converged: bool
    outcome: str
    seconds: float


class InteractiveReplay:
    """A setup whose tool is led by hand; what it remembers (a material's past, friction) is that of
    the hand's way.
    """

    def __init__(self, setup: Setup, grid: Meshing) -> None:
        self.setup = setup
        self._replay = Replay(setup, grid, _TOLERANCE)
        self._surface, self._camera = (
            Surface.of(setup, VERTEX_SPACING),
            np.asarray(camera_model_for(setup).pose.matrix),
        )
        self._last: Equilibrium = self._replay.free
        self._begun = time.monotonic()

    def at(self, centre: FloatArray, *, within: bool = False) -> InteractiveFrame:
        """The block with the tool's centre (3,) [m] there, or where `reachable` puts it; `within`
        asks for its inside, too.
        """
        start, wanted = time.perf_counter(), self.reachable(centre)
        frame = self._replay.solve_from_any(wanted, (self._last,), time.monotonic() - self._begun)
        converged = frame.outcome is Outcome.CONVERGED
        if converged:
            self._last = frame
        shown = self._last
        surface = shown.move(self._surface.vertices)
        inside = InteriorFields.of(self.setup, [shown]) if within else None
        tool = frame.tool.centre
        return InteractiveFrame(
            surface,
            np.full(len(surface), np.nan),
            tool,
            frame.tool.radius,
            self._camera,
            inside,
            self.depth(tool),
            frame.force,
            converged,
            frame.outcome.value,
            time.perf_counter() - start,
        )

    def depth(self, centre: FloatArray) -> float:
        """How far a tool at (3,) [m] reaches into the block at rest [m]."""
        return max(0.0, self.setup.tool.radius - self._apart(centre)[0])

    def reachable(self, centre: FloatArray) -> FloatArray:
        """The place (3,) [m] next to this one where a tool may be: not beyond the base, not too
        deep, not too far away.
        """
        low, high = self.setup.box.low, self.setup.box.high
        radius, deepest = self.setup.tool.radius, DEEPEST * float(np.min(self.setup.box.size))
        place = np.clip(np.asarray(centre, dtype=float), low - _FAR, high + _FAR)
        place[2] = max(place[2], radius)
        apart, outwards = self._apart(place)
        return np.asarray(place + max(0.0, radius - deepest - apart) * outwards)

    def _apart(self, place: FloatArray) -> tuple[float, FloatArray]:
        """Signed distance [m] of a place (3,) to the block, whose base is no way out, and the
        direction (3,) in which it grows.
        """
        low, high = self.setup.box.low - np.array([0.0, 0.0, 1.0]), self.setup.box.high
        outside = place - np.clip(place, low, high)
        apart = float(np.linalg.norm(outside))
        if apart > 0:
            return apart, outside / apart
        gaps = np.concatenate([place - low, high - place])
        nearest = int(gaps.argmin())
        direction = np.zeros(3)
        direction[nearest % 3] = -1.0 if nearest < 3 else 1.0
        return -float(gaps[nearest]), direction
