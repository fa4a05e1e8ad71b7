"""A hypothesis: the stated setup with some effects in it, its predictions, and its columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.effects import Effect, Parameter, Tangent
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Setup

__all__ = ["Model"]


@dataclass(frozen=True, eq=False)
class Model:
    """One hypothesis, compared with the data.

    Attributes:
        effects: its causes.
        setup: the stated setup with them.
        predictions: one for each sequence.
        blocks: quadratic forms, one for each sequence and one for the data at rest.
        layout: what the columns of the quadratic forms are.
        tangents: of the columns `layout.tangents`.
    """

    effects: tuple[Effect, ...]
    setup: Setup
    predictions: tuple[Prediction, ...]
    blocks: tuple[Block, ...]
    layout: ModelColumns
    tangents: tuple[Tangent, ...] = ()

    @property
    def nuisance(self) -> tuple[int, ...]:
        """Columns of the nuisance parameters."""
        return self.layout.nuisances

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of the search coordinates of the effects."""
        return self.layout.effects

    @property
    def parameters(self) -> list[Parameter]:
        """The numbers of all effects, one for each search coordinate."""
        return [item for effect in self.effects for item in effect.numbers()]

    @property
    def scales(self) -> FloatArray:
        """Step that matters of each search coordinate."""
        return np.array([item.scale for item in self.parameters])

    @property
    def coordinates(self) -> FloatArray:
        """Search coordinates of all effects."""
        return np.array([value for effect in self.effects for value in effect.coordinates])

    @property
    def ends(self) -> FloatArray:
        """-1 of each search coordinate at its lower bound, 1 at the upper, else 0."""
        here = self.coordinates
        low, high = np.array([item.ends for item in self.parameters]).reshape(-1, 2).T
        room = CRITERIA.priors.at_bound * self.scales
        return np.where(here - low < room, -1, np.where(high - here < room, 1, 0))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def has_history(self) -> bool:
        """Whether a frame depends on the frames before it."""
        return any(effect.has_history() for effect in self.effects)

    def split(self, values: FloatArray) -> Iterator[tuple[Effect, FloatArray]]:
        """Yield each effect with its part of values (n,), one for each search coordinate."""
        at = 0
        for effect in self.effects:
            count = len(effect.numbers())
            yield effect, values[at : at + count]
            at += count

    def effects_at(self, coordinates: FloatArray) -> Sequence[Effect]:
        """Return the effects at other search coordinates (n,)."""
        return [effect.at(own.tolist()) for effect, own in self.split(coordinates)]
