"""Replay with inertia and Rayleigh damping, by implicit Euler: for comparison with engines that have nothing else.

A tool pushed slowly by position leaves a quasi-static block, whose shape does not depend on its modulus; what does is in here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.errors import SetupError
from core.fem.follow import Follower
from core.fem.inertia import Damping, Inertia
from core.fem.model import BlockModel, Probe
from core.fem.newton import RELATIVE_TOLERANCE, Outcome, Solution
from core.fem.path import lead
from core.frames import FloatArray
from core.memory import refuse_memory
from core.mesh import GridSpec
from core.progress import Report, silent
from core.replay import Equilibrium, Replay
from core.setup import Setup

__all__ = ["Damping", "MovingBlock", "replay_in_time"]


class MovingBlock:
    """A block with a place and a velocity, on an even grid; begins at rest, under its own weight.

    Attributes:
        positions: (n, 3) of the nodes [m]. velocity: (n, 3) [m/s].
    """

    def __init__(self, setup: Setup, grid: GridSpec, damping: Damping, tolerance: float = RELATIVE_TOLERANCE) -> None:
        if grid.spacing is not None:
            raise SetupError("with inertia the grid must be even: a graded one moves through the material", key="spacing")
        if setup.support.friction_coefficient is not None:
            raise SetupError("a sliding base has no inertia here; hold it", key="friction_coefficient")
        if setup.tool.compliance_times_stiffness:
            raise SetupError("a tool that gives way has no inertia here; make it stiff", key="compliance_times_stiffness")
        refuse_memory(setup.material, "a block with inertia has no memory here;")
        self._static = Replay(setup, grid, tolerance)
        self.model: BlockModel = self._static.model(self._static.free.mesh)
        self.positions = self.model.mesh.nodes + self._static.free.displacement
        self.velocity = np.zeros_like(self.positions)
        self._inertia = Inertia(self.model, setup.mass / float(np.prod(setup.box.size)), damping)
        self._offset, self._radius = np.array(setup.tool.offset), setup.tool.radius
        self._follower, self._tolerance = Follower(), tolerance
        self._probe: Probe | None = None

    def place(self, stated_centre: FloatArray) -> Equilibrium:
        """Begin at rest with the tool at a stated centre (3,) [m]: a static equilibrium."""
        frame = self._static.step(stated_centre)
        self.positions, self.velocity[:] = frame.mesh.nodes + frame.displacement, 0.0
        self._probe = frame.probe
        return frame

    def advance(self, stated_centre: FloatArray, seconds: float) -> Solution:
        """One step of implicit Euler, at whose end the tool is at a stated centre (3,) [m]."""
        model, free = self.model, self.model.topology.free
        probe = Probe(stated_centre + self._offset, self._radius)
        model.carried = self._inertia.step(seconds, (self.positions - model.mesh.nodes)[free], self.velocity[free])
        try:
            solution = lead(model, self.positions, self._probe or probe, probe, self._tolerance, self._follower)
        finally:
            model.carried = None
        self.velocity = (solution.positions - self.positions) / seconds
        self.positions, self._probe = solution.positions, probe
        return solution

    def frame(self, solution: Solution, iterations: int) -> Equilibrium:
        """The state as a frame of a replay."""
        assert self._probe is not None
        return Equilibrium(
            self.model.mesh, self.positions - self.model.mesh.nodes, np.zeros(2), self._probe,
            -solution.push * self.model.setup.material.young_modulus, solution.outcome, iterations, solution.residual,
            solution.penetration, bool(solution.push.any()),
        )  # fmt: skip


def replay_in_time(
    setup: Setup,
    centres: FloatArray,
    times: Sequence[float] | FloatArray,
    grid: GridSpec,
    *,
    damping: Damping,
    steps: int = 1,
    tolerance: float = RELATIVE_TOLERANCE,
    report: Report = silent,
) -> list[Equilibrium]:
    """One frame at each time, with inertia.

    Args:
        setup: what is believed; its mass and Young's modulus count here. centres: (f, 3) stated tool centres [m], phantom frame.
        times: (f,) [s], growing. grid: an even mesh. damping: Rayleigh's. steps: of implicit Euler from frame to frame, between
            which the tool moves evenly. tolerance, report: as for `core.replay.replay`.

    A frame in which one of the steps found no equilibrium carries that step's outcome; the block goes on from where it was left,
    at rest.
    """
    times = np.asarray(times, dtype=float)
    if len(times) != len(centres) or (np.diff(times) <= 0).any():
        raise SetupError("a replay in time needs one time per frame, each later than the one before", key="times")
    if steps < 1:
        raise SetupError(f"a replay in time takes at least one step from frame to frame, not {steps}", key="steps")
    block = MovingBlock(setup, grid, damping, tolerance)
    frames: list[Equilibrium] = []
    for number, centre in enumerate(np.asarray(centres, dtype=float)):
        report(number / len(centres), f"frame {number + 1} of {len(centres)}")
        if not frames:
            frames.append(block.place(centre))
            continue
        frames.append(_advanced(block, centres[number - 1], centre, (times[number] - times[number - 1]) / steps, steps))
    return frames


def _advanced(block: MovingBlock, last: FloatArray, centre: FloatArray, seconds: float, steps: int) -> Equilibrium:
    failed, iterations = None, 0
    for share in np.arange(1, steps + 1) / steps:
        solution = block.advance(last + share * (centre - last), seconds)
        iterations += solution.iterations
        if solution.outcome is not Outcome.CONVERGED:
            failed, block.velocity = failed or solution, np.zeros_like(block.velocity)
    return block.frame(failed or solution, iterations)
