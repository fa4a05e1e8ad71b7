"""One set of a batch between two frames: where its solve begins, and what becomes of the solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.equilibrium import Equilibrium
from core.fem.model import BlockModel, Probe
from core.fem.newton import Outcome, Solution
from core.fem.path import DEEPEST, FREE_STEP
from core.frames import FloatArray
from core.mesh import GridSpec
from core.meshing import Mesh
from core.replay import Replay
from core.setup import Setup

__all__ = ["Begin", "Member"]


@dataclass(frozen=True, eq=False)
class Begin:
    """A solve to be done: from positions (n, 3) [m] with the tool at `before`, to `probe`; `further` (n, 3) [m] is where the frames
    before point to."""

    model: BlockModel
    positions: FloatArray
    further: FloatArray
    before: Probe
    probe: Probe


class Member(Replay):
    """A replay whose solves are done elsewhere, together with those of others; frames that fail there are done here."""

    def __init__(self, setup: Setup, grid: GridSpec, tolerance: float) -> None:
        super().__init__(setup, grid, tolerance)
        self.frames: list[Equilibrium] = []

    @property
    def weighs(self) -> bool:
        """Whether the block deforms without the tool."""
        return bool(self.setup.load.specific_weight_over_stiffness)

    def sag(self) -> Begin:
        """The solve without the tool."""
        size = self.setup.box.size
        model = self.model(self.grid.mesh(self.setup, np.array([0.0, 0.0, size[2]])))
        away = Probe(np.array([0.0, 0.0, 10.0]), self.setup.tool.radius)
        return Begin(model, model.mesh.nodes, model.mesh.nodes, away, away)

    def rested(self, begin: Begin, solution: Solution) -> None:
        """Take the solution of `sag`, if it is one; else the block is laid down when it is first asked for."""
        if solution.converged:
            self.free = self._equilibrium(solution, begin.model.mesh, begin.probe)

    def begin(self, centre: FloatArray) -> Begin | None:
        """The solve for the next frame, with the tool stated at `centre` (3,) [m]; None when it does not touch, or is felt at more
        points than the others' tools are.
        """
        probe = Probe(centre + self._offset, self.setup.tool.radius)
        start = self._previous or self.free
        if self.away(probe) or start.dense:
            return None
        self.dense = False
        model, positions, before, _ = self.set_out(probe, start)
        model.harden(1.0)
        return Begin(model, positions, positions + self._further(start, model.mesh, probe), before, probe)

    @property
    def _previous(self) -> Equilibrium | None:
        """The frame before, if it can be begun from."""
        found = self.frames[-1:]
        return found[0] if found and found[0].outcome is Outcome.CONVERGED else None

    def _further(self, start: Equilibrium, mesh: Mesh, probe: Probe) -> FloatArray:
        """How far (n, 3) [m] the block goes on if it keeps moving with the tool as between the last two frames."""
        if len(self.frames) < 2 or start is not self.frames[-1]:
            return np.zeros_like(start.displacement)
        earlier = self.frames[-2]
        last, now = start.probe.centre - earlier.probe.centre, probe.centre - start.probe.centre
        same = earlier.in_contact and earlier.mesh is start.mesh is mesh
        if not same or not last.any() or max(np.linalg.norm(last), np.linalg.norm(now)) > FREE_STEP:
            return np.zeros_like(start.displacement)
        share = float(now @ last / (last @ last))
        return np.asarray(min(max(share, -1.0), 1.5) * (start.displacement - earlier.displacement))

    def take(self, begin: Begin, solution: Solution) -> bool:
        """Take the solution for the next frame, if it is one that needs no harder contact."""
        if not solution.converged or solution.penetration > DEEPEST:
            return False
        self.frames.append(self._equilibrium(solution, begin.model.mesh, begin.probe))
        return True

    def alone(self, centre: FloatArray) -> None:
        """Do the next frame without the others, as `core.replay.replay` does it."""
        self.frames.append(self.sought(centre, (self._previous,)))
