"""Priors and scores of models: how well each explains the data within the stated accuracies."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evidence import Block, fit, log_evidence, predictive_score
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import InferenceProblem
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.foundation.arrays import FloatArray

__all__ = ["InferenceState", "Posterior"]


@dataclass(eq=False)
class InferenceState:
    """The mutable state of a search.

    Attributes:
        noises: noise of each sequence; empty until the baseline is known.
        temperature: misfit per value of the best model so far, by which log densities are divided.
        on_diagnosis_grid: the stated setup on the grid of the diagnosis, where it states another.
        recent: the first model evaluated and the last one, which others may reuse.
        evaluations: number of replays of all sequences.
        work: number of equilibria that were solved.
        unit: the same of the first replay of all sequences.
        stated: log evidence of the stated setup at its own temperature [nats].
        cut_short: names of the effects of fits that ended at their budget of work.
        progress: share that is done [1].
    """

    noises: list[Noise] = field(default_factory=list)
    temperature: float = 1.0
    on_diagnosis_grid: tuple[Prediction, ...] = ()
    recent: list[Model] = field(default_factory=list)
    evaluations: int = 0
    work: int = 0
    unit: int = 0
    stated: float = np.inf
    cut_short: set[tuple[str, ...]] = field(default_factory=set)
    progress: float = 0.0


class Posterior:
    """Scores models of one inference problem.

    Args:
        problem: to be solved.

    Attributes:
        problem: as given.
        state: noise, temperature and counters.
    """

    def __init__(self, problem: InferenceProblem) -> None:
        self.problem, self.state = problem, InferenceState()

    def precision(self, model: Model, nuisances: FloatArray | None = None) -> FloatArray:
        """Return the prior precision (n, n) of nuisances and search coordinates.

        Args:
            model: with the search coordinates.
            nuisances: precision of the nuisances; as stated without it.
        """
        size = len(model.nuisance) + len(model.columns)
        precision = np.zeros((size, size))
        precision[: len(model.nuisance), : len(model.nuisance)] = (
            self.problem.nuisances.precision if nuisances is None else nuisances
        )
        own = np.arange(len(model.nuisance), size)
        precision[own, own] = (
            (CRITERIA.priors.parameter_steps * model.scales) ** -2 if len(own) else 0
        )
        return precision

    def bounded_precision(self, model: Model, nuisances: FloatArray | None = None) -> FloatArray:
        """Return `precision` with the coordinates held that are pulled beyond a bound.

        A Gaussian prior alone would let a weight of zero become negative, which imitates a block of
        another height.
        """
        precision, first = self.precision(model, nuisances), len(model.nuisance)
        columns, ends = [*model.nuisance, *model.columns], model.ends
        while (ends != 0).any():
            change = fit(self.tempered(model), columns, precision).change[first:]
            pressed = first + np.flatnonzero(ends * change > 0)
            if not len(pressed):
                break
            precision[pressed, pressed] = (
                CRITERIA.priors.bound_precision * model.scales[pressed - first] ** -2
            )
            ends[pressed - first] = 0
        return precision

    def tempered(self, model: Model) -> list[Block]:
        """Return the model's blocks, those of sequences divided by the temperature."""
        return [
            Block(
                block.name,
                block.gram / (self.state.temperature if block.name != "rest" else 1.0),
                block.values,
            )
            for block in model.blocks
        ]

    def misfit(self, model: Model) -> float:
        """Return the misfit per value at the best nuisances; one when only noise is left."""
        blocks = [block for block in model.blocks if block.name != "rest"]
        best = fit(blocks, [*model.nuisance, *model.columns], self.bounded_precision(model))
        return best.misfit / sum(block.values for block in blocks)

    def score(self, model: Model) -> FloatArray:
        """Return the log predictive density of each block given the others [nats]."""
        return predictive_score(
            self.tempered(model),
            [*model.nuisance, *model.columns],
            self.bounded_precision(model),
            len(model.nuisance),
        )

    def objective(self, model: Model, nuisances: FloatArray | None = None) -> float:
        """Return the log evidence at the model's search coordinates [nats].

        Args:
            model: to be scored.
            nuisances: as for `precision`.
        """
        return log_evidence(
            self.tempered(model),
            model.nuisance,
            self.problem.nuisances.precision if nuisances is None else nuisances,
        )
