"""Fits that come to rest beside a kink, on a function of one number whose best value is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from palpate.diagnosis.inference.evidence import Block, log_evidence
from palpate.diagnosis.inference.gauss_newton import best_fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.inference.posterior import InferenceState
from palpate.effects import Effect
from palpate.effects.support import BaseCompliance, BaseSlip
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Setup, Tool

BEST, KINK, REST = np.log(0.15), np.log(0.143), np.log(0.139)
PRIOR = np.array([[1e-6]])
SETUP = Setup(geometry=Box(size=(0.07, 0.04, 0.036)), tool=Tool(radius=5e-3))


@dataclass
class Slope:
    """Residuals (2,) that are linear in one coordinate and vanish at `best`; below a `kink` others
    do not quite vanish at `REST`.

    It keeps the coordinates at which it was evaluated, and solves `work` equilibria for each.
    """

    best: float = BEST
    kink: float = KINK
    evaluated: list[float] = field(default_factory=list)
    state: InferenceState = field(default_factory=lambda: InferenceState(unit=1))
    work: int = 1

    def evaluate(self, effects: Sequence[Effect], starts: Any) -> Model:
        (at,) = effects[0].coordinates
        self.evaluated.append(at)
        self.state.work += self.work
        rows = np.array([[0.0, 300.0 * (at - self.best)], [0.0, 300.0]])
        if at < self.kink:
            rows = np.array([[10.0, 200.0 * (at - REST)], [0.0, 200.0]])
        return Model(
            tuple(effects), SETUP, (), (Block("one", rows @ rows.T, 1.0),), ModelColumns((), (0,))
        )

    def objective(self, model: Model, nuisances: FloatArray) -> float:
        return log_evidence(model.blocks, (), np.zeros((0, 0)))

    def tempered(self, model: Model) -> list[Block]:
        return list(model.blocks)

    def bounded_precision(self, model: Model, nuisances: FloatArray) -> FloatArray:
        return PRIOR


def _fit(slope: Slope, effect: Effect, hopeless: float = -np.inf) -> Model:
    return best_fit(slope, slope.evaluate([effect], None), np.zeros((0, 0)), hopeless)  # type: ignore[arg-type]


@pytest.mark.parametrize("start", [0.12, 0.139, 0.145, 0.22])
def test_the_best_friction_is_found_from_either_side_of_a_kink(start: float) -> None:
    found = _fit(Slope(), BaseSlip(friction_coefficient=start))
    assert found.effects[0].coordinates[0] == pytest.approx(BEST, abs=2e-3)


def test_without_a_kink_nothing_is_asked_beside_the_optimum() -> None:
    smooth = Slope(best=np.log(30.0), kink=-np.inf)
    found = _fit(smooth, BaseCompliance(stiffness_over_E=50.0))
    assert found.effects[0].coordinates[0] == pytest.approx(np.log(30.0), abs=2e-3)
    assert len(smooth.evaluated) <= 3


def test_a_fit_that_is_given_up_is_not_asked_again() -> None:
    slope = Slope()
    _fit(slope, BaseSlip(friction_coefficient=0.139), hopeless=1e6)
    assert len(slope.evaluated) == 1


def test_a_fit_ends_at_its_budget_and_is_noted() -> None:
    dear = Slope(work=40)
    found = _fit(dear, BaseSlip(friction_coefficient=0.3))
    assert len(dear.evaluated) == 2
    assert dear.state.cut_short == {found.names}
    cheap = Slope()
    _fit(cheap, BaseSlip(friction_coefficient=0.3))
    assert len(cheap.evaluated) > 2 and not cheap.state.cut_short
