"""Interactive replay: one equilibrium for each requested tool position, from the last one on."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.measurement.camera_model import camera_model_for
from palpate.mesh.protocol import Meshing
from palpate.recording.interior_fields import InteriorFields
from palpate.recording.record_sequence import VERTEX_SPACING
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup

__all__ = ["DEEPEST", "InteractiveFrame", "InteractiveReplay"]

DEEPEST = 0.25
"""Largest depth of an interactive push, over the block's shortest side [1]: deeper ones take too
long to solve."""
_FAR = 0.06
"""Largest distance of the tool from the block [m]."""
_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class InteractiveFrame:
    """Response of the block, phantom frame, SI; arrays as in a recording.

    Attributes:
        surface: (v, 3) moved material vertices [m]; those of the last equilibrium if this is none.
        error: (v,) NaN, because nothing was measured.
        tool: (3,) true centre [m].
        radius: of the tool [m].
        camera: (4, 4) phantom_from_camera.
        inside: interior fields as of a recording of one frame; None if not requested.
        depth: of the tool in the block at rest [m].
        force: (3,) on the tool [N].
        converged: whether this is an equilibrium.
        outcome: how the solve ended.
        seconds: duration of the solve [s].
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
    """A replay whose tool is moved by hand; history and friction follow the path of the hand.

    Args:
        setup: the experiment.
        grid: mesh specification.
    """

    def __init__(self, setup: Setup, grid: Meshing) -> None:
        self.setup = setup
        self._replay = Replay(setup, grid, _TOLERANCE)
        self._surface, self._camera = (
            setup.surface(VERTEX_SPACING),
            np.asarray(camera_model_for(setup).pose.matrix),
        )
        self._last: Equilibrium = self._replay.free
        self._begun = time.monotonic()

    def at(self, centre: FloatArray, *, within: bool = False) -> InteractiveFrame:
        """The block with the tool's centre (3,) [m] there, or where `reachable` moves it.

        `within` requests the interior fields.
        """
        start, place = time.perf_counter(), self.reachable(centre)
        frame = self._replay.solve_from_any(place, (self._last,), time.monotonic() - self._begun)
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
        """Depth of a tool at (3,) [m] in the block at rest [m]."""
        return max(0.0, self.setup.tool.radius - self._apart(centre)[0])

    def reachable(self, centre: FloatArray) -> FloatArray:
        """The nearest permitted position (3,) [m]: not below the base, not too deep, not too far
        away.
        """
        geometry, radius = self.setup.geometry, self.setup.tool.radius
        low, high, deepest = geometry.low, geometry.high, DEEPEST * float(np.min(geometry.size))
        place = np.clip(np.asarray(centre, dtype=float), low - _FAR, high + _FAR)
        place[2] = max(place[2], radius)
        apart, outwards = self._apart(place)
        return np.asarray(place + max(0.0, radius - deepest - apart) * outwards)

    def _apart(self, place: FloatArray) -> tuple[float, FloatArray]:
        """Signed distance [m] of a point (3,) to the phantom, and the direction (3,) in which it
        grows.

        The base of a block does not count as a side.
        """
        distance, normal = self.setup.geometry.facing(place[None])
        return float(distance[0]), normal[0]
