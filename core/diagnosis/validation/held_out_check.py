"""Checks a verdict of none on held-out sequences.

An error in one kind of push or at one place need not appear in the fitted sequences. Held-out
sequences never choose a cause, but structured error in them rules out the verdict none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.residual_structure import Structure, structure_of
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.diagnosis.validation.stiffness_error_test import (
    StiffnessErrorTest,
    largest_stiffness_error,
)

__all__ = ["HeldOutCheck", "check_held_out", "held_out_evaluator"]


@dataclass(frozen=True, eq=False)
class HeldOutCheck:
    """The stated setup on held-out sequences.

    Attributes:
        model: the stated setup with their predictions.
        structure: structured error that it leaves.
        stiffness_error: test of the engine's error on them.
    """

    model: Model
    structure: Structure
    stiffness_error: StiffnessErrorTest | None = None


def held_out_evaluator(evaluator: Evaluator, held_out: Sequence[Observations]) -> Evaluator | None:
    """Return an evaluator of the sequences with clouds, which the workers must have; None without
    such sequences.
    """
    names = [item.name for item in held_out if not item.force_only]
    if not names:
        return None
    problem = replace(
        evaluator.problem,
        names=tuple(names),
        clouds=True,
        pushes=(np.empty((0, 3)), np.empty((0, 3))),
    )
    return Evaluator(problem, evaluator.workers)


def check_held_out(
    evaluator: Evaluator, held_out: Sequence[Observations], seed: int
) -> HeldOutCheck | None:
    """Check the sequences with clouds, which the workers must have; None without such sequences."""
    other = held_out_evaluator(evaluator, held_out)
    if other is None:
        return None
    model = other.baseline((), inclusion_places(other.problem))
    return HeldOutCheck(
        model, structure_of(other, model, seed), largest_stiffness_error(other, model)
    )
