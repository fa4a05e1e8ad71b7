"""A replayed frame with a network's correction on top, which can be compared with clouds as any other frame can."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from core.diagnosis.comparison import compare
from core.diagnosis.observations import Observations
from core.diagnosis.prediction import Prediction
from core.equilibrium import Equilibrium
from core.frames import FloatArray
from core.measurement import Surface
from core.mesh import BoxMesh
from core.setup import Setup

__all__ = ["CorrectedFrame", "Corrector", "corrected_frame", "corrected_prediction", "tools_of"]

Corrector = Callable[[FloatArray, FloatArray], FloatArray]
"""From simulated points (n, v, 3) [m] of a grid and the tool (n, 13), see `core.correction.samples`: how far each is moved [m]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrectedFrame(Equilibrium):
    """An equilibrium, moved further by `change` (v, 3) [m] at the nodes of an even grid and linearly between them.

    The solved surface keeps what is finer than the grid that the network sees: only the correction is interpolated.
    """

    sampled: BoxMesh
    change: FloatArray

    def move(self, points: FloatArray) -> FloatArray:
        """Current positions of material points given by their rest positions (m, 3) [m]."""
        return super().move(points) + self.sampled.interpolate(self.change, points)


def corrected_frame(frame: Equilibrium, sampled: BoxMesh, change: FloatArray) -> CorrectedFrame:
    """This frame with a correction (v, 3) [m] at the nodes of a grid."""
    return CorrectedFrame(**{item.name: getattr(frame, item.name) for item in fields(Equilibrium)}, sampled=sampled, change=change)


def corrected_prediction(
    model: Prediction, data: Observations, setup: Setup, sampled: BoxMesh, corrector: Corrector, tool: FloatArray
) -> Prediction:
    """A model's prediction of one sequence with its frames corrected; the same points are averaged in the same patches.

    Args:
        model: with its samples. setup: under which it was made. sampled: the grid that the corrector takes.
        tool: (g, 13) of each group; see `tools_of`.
    """
    surface = Surface.of(setup)
    change = corrector(np.stack([frame.move(sampled.nodes) for frame in model.equilibria]), tool)
    frames = [corrected_frame(frame, sampled, one) for frame, one in zip(model.equilibria, change, strict=True)]
    rows = zip(data.groups, frames, model.samples, strict=True)
    means = [compare(group, setup, frame, surface, sample).means for group, frame, sample in rows]
    return replace(
        model, gap=np.stack([one.mean for one in means]), count=np.stack([one.count for one in means]).astype(float),
        spread=np.stack([one.spread for one in means]), equilibria=tuple(frames), columns=model.columns[..., :0],
    )  # fmt: skip


def tools_of(model: Prediction, data: Observations, columns: FloatArray, measured: bool) -> FloatArray:
    """What a network is told of the tool in each group (g, 13): the mean over its frames, of `columns` (f, 13) of all frames.

    The rest cloud has no tool; it is told the one of the first untouched group. Without a sensor the force is the simulation's.
    """
    first: Sequence[int] = next((group.frames for group in data.groups if group.free and group.frames), data.groups[-1].frames)
    found = np.stack([columns[list(group.frames or first)].mean(axis=0) for group in data.groups])
    if not measured:
        found[:, 10:] = [frame.force for frame in model.equilibria]
    return found
