"""Predictions of a sequence whose frames a network has corrected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.ray_comparison import compare
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Setup

__all__ = ["FrameCorrection", "corrected_prediction", "tool_inputs"]

FrameCorrection = Callable[[Equilibrium, FloatArray], Equilibrium]
"""Corrects a frame. Takes the frame and the tool (13,) as in
`palpate.correction.samples.sample_store`; returns the frame with its shape corrected."""


def corrected_prediction(
    model: Prediction, data: Observations, setup: Setup, correct: FrameCorrection, tools: FloatArray
) -> Prediction:
    """Return a prediction of one sequence with its frames corrected.

    The same measured points are averaged over the same patches.

    Args:
        model: the model's prediction, with its samples.
        data: the observations that it predicts.
        setup: the setup of the prediction.
        correct: the correction of a frame.
        tools: (g, 13) tool of each group, see `tool_inputs`.
    """
    surface = setup.surface()
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
    """Return the network's tool input for each group (g, 13), the mean over the group's frames.

    The rest cloud has no tool; its input is that of the first untouched group.

    Args:
        data: the observations of one sequence.
        columns: (f, 13) tool inputs of all frames of the sequence.
    """
    first: Sequence[int] = next(
        (group.frames for group in data.groups if group.free and group.frames),
        data.groups[-1].frames,
    )
    return np.stack([columns[list(group.frames or first)].mean(axis=0) for group in data.groups])
