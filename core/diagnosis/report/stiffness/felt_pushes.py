"""The pushes of all fitted sequences, and the cells that each of them feels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import less_constants
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import Noise, rows_of
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["FeltPush", "felt_pushes"]


@dataclass(frozen=True, eq=False)
class FeltPush:
    """One push: all frames from a touch to the next time that the tool is clear.

    Attributes:
        number: counted through all fitted sequences, from 1.
        sequence: its name.
        place: (3,) of the stated surface, where it shows most [m].
        normal: (3,) outwards there.
        signal: (m,) change of its data by the contrast of each cell, over noise [1].
    """

    number: int
    sequence: str
    place: FloatArray
    normal: FloatArray
    signal: FloatArray


def felt_pushes(
    evaluator: Evaluator, data: Sequence[Observations], model: Model
) -> tuple[FeltPush, ...]:
    """Return the pushes of all sequences in their order.

    Args:
        evaluator: of the fitted sequences.
        data: the same.
        model: whose columns of inclusions are the cells.
    """
    found: list[FeltPush] = []
    setup = evaluator.problem.setup
    for item, prediction, noise in zip(
        data, model.predictions, evaluator.state.noises, strict=True
    ):
        squares = _squares(prediction, noise, list(model.layout.inclusions))
        number, centres = _runs(item, prediction), item.centres(setup)
        for push in range(1, number.max(initial=0) + 1):
            rows = np.flatnonzero(number == push)
            if not len(rows):
                continue
            best = rows[int(squares[rows].sum(axis=1).argmax())]
            distance, normal = setup.geometry.facing(centres[best][None])
            found.append(
                FeltPush(
                    number=len(found) + 1,
                    sequence=item.name,
                    place=centres[best] - distance[0] * normal[0],
                    normal=normal[0],
                    signal=np.sqrt(squares[rows].sum(axis=0)),
                )
            )
    return tuple(found)


def _squares(prediction: Prediction, noise: Noise, cells: list[int]) -> FloatArray:
    """Squared change (g, m) of each group's data by each cell, over noise."""
    columns = rows_of(prediction)[1][..., cells].astype(float)
    known = noise.weights > 0
    columns = np.where(known[..., None], columns, 0.0)
    if noise.centred:
        columns = np.where(known[..., None], less_constants(columns, noise.weights), 0.0)
    return np.asarray((noise.weights[..., None] * columns**2).sum(axis=1))


def _runs(item: Observations, prediction: Prediction) -> IntArray:
    """Number (g,) of the push of each group; 0 without contact."""
    touched = np.array([frame.in_contact for frame in prediction.equilibria])
    if item.force_only:
        number = np.array([group.push for group in item.groups])
    else:
        number = np.cumsum(np.diff(touched.astype(int), prepend=0) == 1)
    return np.where(touched, number, 0)
