"""The block in one frame of a replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.fem.continuation import FREE_STEP
from palpate.fem.friction import FrictionHistory
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.mesh.protocol import Mesh

__all__ = ["Equilibrium", "extrapolated", "predict_from_similar", "require_converged"]


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The block in one frame.

    Attributes:
        mesh: its elements.
        displacement: (n, 3) of the nodes against the stated shape [m], without `slip`.
        slip: (2,) how far the base has slid along x and y [m].
        tool: the tool (true centre and radius), phantom frame.
        force: (3,) of the block on the tool [N].
        outcome, iterations, residual, penetration: how it was reached.
        hardness: of the contact, see `palpate.fem.model.BlockModel.harden`.
        dense: whether the surface felt the tool at many points, see `palpate.fem.model.BlockModel`.
        friction_history: what friction leaves to the next frame; None without.
        path: with friction at the tool or under the base, equilibria on the way from the frame
            before.
    """

    mesh: Mesh
    displacement: FloatArray
    slip: FloatArray
    tool: ToolSphere
    force: FloatArray
    outcome: Outcome
    iterations: int
    residual: float
    penetration: float
    in_contact: bool
    friction_history: FrictionHistory | None = None
    hardness: float = 1.0
    dense: bool = False
    path: tuple[Equilibrium, ...] = ()

    @cached_property
    def _moved(self) -> FloatArray:
        return np.asarray(self.displacement + np.append(self.slip, 0.0))

    @cached_property
    def at_rest(self) -> bool:
        """Whether every point of the block is where it is stated to be."""
        return not self._moved.any()

    def move(self, points: FloatArray) -> FloatArray:
        """Current positions of material points given by their rest positions (m, 3) [m]."""
        return points if self.at_rest else points + self.mesh.interpolate(self._moved, points)


def require_converged(frames: Sequence[Equilibrium]) -> None:
    """Raise SolveError that names the first frame without equilibrium, its residual and the
    cause."""
    for number, frame in enumerate(frames):
        if frame.outcome is not Outcome.CONVERGED:
            raise SolveError(
                f"frame {number}: {frame.outcome.value} (residual {frame.residual:.2g} after {frame.iterations} iterations)",
                frame=number,
                residual=frame.residual,
                outcome=frame.outcome.name,
            )


def extrapolated(
    model: BlockModel,
    last: tuple[Equilibrium, Equilibrium],
    positions: FloatArray,
    tool: ToolSphere,
) -> FloatArray:
    """Where the last two frames point to (n, 3) [m], if that lies lower in energy than the last
    one's `positions`.

    `tool` is the tool's next place, seen from the slid block.
    """
    earlier, start = last
    if not (earlier.in_contact and earlier.mesh is start.mesh is model.mesh):
        return positions
    here = start.tool.centre - np.append(start.slip, 0.0)
    way, now = here - (earlier.tool.centre - np.append(earlier.slip, 0.0)), tool.centre - here
    if not way.any() or max(np.linalg.norm(way), np.linalg.norm(now)) > FREE_STEP:
        return positions
    share = float(now @ way / (way @ way))
    guess = positions + min(max(share, -1.0), 1.5) * (start.displacement - earlier.displacement)
    return guess if model.energy(guess, tool) < model.energy(positions, tool) else positions


def predict_from_similar(
    model: BlockModel,
    lesson: tuple[Equilibrium, Equilibrium],
    start: Equilibrium,
    positions: FloatArray,
    tool: ToolSphere,
) -> FloatArray:
    """Where a frame of a similar setup points to (n, 3) [m], together with what the last one was
    found to be off by.

    Args:
        lesson: the last frame's start, and what was found from there.
        start: of the frame that is sought, whose `positions` are on the model's mesh; they are
            returned where the lesson leads to no lower energy.
        tool: as for `extrapolated`.
    """
    other, found = lesson
    here = start.tool.centre - np.append(start.slip, 0.0)
    useful = (
        other.in_contact
        and found.in_contact
        and start.in_contact
        and np.linalg.norm(tool.centre - here) <= FREE_STEP
    )
    if not useful or found.outcome is not Outcome.CONVERGED:
        return positions
    nodes, focus = model.mesh.nodes, model.mesh.focus
    moved = [
        one.mesh.interpolate(one.displacement, nodes - (focus - one.mesh.focus))
        for one in (found, other)
    ]
    guess = np.where(model.topology.free, positions + moved[0] - moved[1], positions)
    return guess if model.energy(guess, tool) < model.energy(positions, tool) else positions
