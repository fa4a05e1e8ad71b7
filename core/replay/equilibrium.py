"""Equilibrium of the block in one frame of a replay."""

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
        mesh: of the block.
        displacement: (n, 3) of the nodes from the stated shape [m], without `slip`.
        slip: (2,) accumulated slip of the base along x and y [m].
        tool: true centre and radius, phantom frame.
        force: (3,) of the block on the tool [N].
        outcome: whether this is an equilibrium, or why not.
        iterations: number of Newton steps.
        residual: relative.
        penetration: of the surface into the tool [m].
        in_contact: whether the tool touches the block.
        friction_history: state of friction for the next frame; None without friction.
        hardness: of the contact, see `palpate.fem.model.BlockModel.harden`.
        dense: whether contact was evaluated at many points, see `palpate.fem.model.BlockModel`.
        path: with friction at the tool or under the base, equilibria between the frame before and
            this one.
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
        """Whether every point of the block is at its stated position."""
        return not self._moved.any()

    def move(self, points: FloatArray) -> FloatArray:
        """Current positions of material points given by their rest positions (m, 3) [m]."""
        return points if self.at_rest else points + self.mesh.interpolate(self._moved, points)


def require_converged(frames: Sequence[Equilibrium]) -> None:
    """Raise SolveError for the first frame without equilibrium, with its residual and cause."""
    for number, frame in enumerate(frames):
        if frame.outcome is not Outcome.CONVERGED:
            raise SolveError(
                f"frame {number}: {frame.outcome.value} "
                f"(residual {frame.residual:.2g} after {frame.iterations} iterations)",
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
    """Extrapolate the last two frames, if that has a lower energy than `positions`.

    Args:
        model: of the block.
        last: the last two frames.
        positions: (n, 3) of the last frame [m].
        tool: next, in the frame of the block.

    Returns:
        positions (n, 3) [m].
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
    """Predict a frame from a similar setup's frame, corrected by the last frame's prediction error.

    Args:
        model: of the block.
        lesson: the start of the last frame, and the equilibrium found from there.
        start: of the frame to be solved.
        positions: (n, 3) of `start` on the model's mesh [m]; returned if the prediction has no
            lower energy.
        tool: next, in the frame of the block.

    Returns:
        positions (n, 3) [m].
    """
    other, solved = lesson
    here = start.tool.centre - np.append(start.slip, 0.0)
    useful = (
        other.in_contact
        and solved.in_contact
        and start.in_contact
        and np.linalg.norm(tool.centre - here) <= FREE_STEP
    )
    if not useful or solved.outcome is not Outcome.CONVERGED:
        return positions
    nodes, focus = model.mesh.nodes, model.mesh.focus
    moved = [
        one.mesh.interpolate(one.displacement, nodes - (focus - one.mesh.focus))
        for one in (solved, other)
    ]
    guess = np.where(model.topology.free, positions + moved[0] - moved[1], positions)
    return guess if model.energy(guess, tool) < model.energy(positions, tool) else positions
