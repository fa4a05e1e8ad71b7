"""A model's prediction of a sequence with a network's correction on top, which is compared with
clouds as any other is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.ray_comparison import compare
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.measurement.surface_gaps import Surface
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Setup

__all__ = ["FrameCorrection", "corrected_prediction", "tool_inputs"]

FrameCorrection = Callable[[Equilibrium, FloatArray], Equilibrium]
"""A frame, and the tool (13,) there as in `palpate.correction.samples.sample_store`, to the frame
with its shape corrected."""


def corrected_prediction(
    model: Prediction, data: Observations, setup: Setup, correct: FrameCorrection, tools: FloatArray
) -> Prediction:
    """A model's prediction of one sequence with its frames corrected; the same points are averaged
    in the same patches.

    Args:
        model: with its samples.
        setup: under which it was made.
        tools: (g, 13) of each group, see `tool_inputs`.
    """
    surface = Surface.of(setup)
    frames = [correct(frame, tool) for frame, tool in zip(model.equilibria, tools, strict=True)]
    rows = zip(data.groups, frames, model.samples, strict=True)
    means = [compare(group, setup, frame, surface, sample).means for group, frame, sample in rows]
    return replace(
        model,
        gap=np.stack([one.mean for one in means]),
        count=np.stack([one.count for one in means]).astype(float),
        spread=np.stack([one.spread for one in means]),
        equilibria=tuple(frames),
        columns=model.columns[..., :0],
    )


def tool_inputs(data: Observations, columns: FloatArray) -> FloatArray:
    """What a network is told of the tool in each group (g, 13): the mean over its frames, of
    `columns` (f, 13) of all frames.

    The rest cloud has no tool; it is told the one of the first untouched group.
    """
    first: Sequence[int] = next(
        (group.frames for group in data.groups if group.free and group.frames),
        data.groups[-1].frames,
    )
    return np.stack([columns[list(group.frames or first)].mean(axis=0) for group in data.groups])
