"""Negative control of a cause in sequences without clouds: with exchanged pushes it loses its gain.

As in `palpate.diagnosis.validation.negative_controls`, the residual of the model without the cause
stays as measured, and the cause's pattern is falsified. The pattern is the share by which the cause
changes the force of each push. These shares are passed on to the push half way round the sequence.
No replay is needed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import rows_of
from palpate.diagnosis.validation.negative_controls import Control, judge
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["EXCHANGED", "exchanged", "force_controls"]

EXCHANGED = "pushes exchanged"


def force_controls(evaluator: Evaluator, model: Model, baseline: Model) -> tuple[Control, ...]:
    """Compute the control of every cause of an accepted model, on sequences without clouds."""
    results = []
    first = evaluator.problem.blocks.replayed
    for index, left in enumerate(model.effects):
        others = [effect for number, effect in enumerate(model.effects) if number != index]
        origin: Sequence[Prediction] = baseline.predictions
        if others:
            origin = evaluator.replayed(others, model.predictions)
        blocks = []
        for noise, before, after in zip(
            evaluator.state.noises, origin, model.predictions, strict=True
        ):
            pattern = np.nan_to_num(rows_of(after)[0] - rows_of(before)[0])
            pattern[list({*before.failed, *after.failed})] = 0.0
            assert after.forces is not None and after.forces.push is not None
            other = exchanged(pattern, after.forces.force, after.forces.push)
            nuisances = rows_of(after)[1][..., :first]
            block = noise.block(
                before.replace_columns(
                    np.concatenate([nuisances, np.stack([pattern, other], axis=2)], axis=2)
                )
            )
            blocks.append(Block(block.name, block.gram / evaluator.state.temperature, block.values))
        results += judge(evaluator, blocks, left, (EXCHANGED,))
    return tuple(results)


def exchanged(pattern: FloatArray, force: FloatArray, push: IntArray) -> FloatArray:
    """Exchange a pattern between pushes half way round the sequence, as shares of their forces.

    Groups of a push are matched in their order; the last one stands for missing ones.

    Args:
        pattern: (g, 3) change of the force by the cause [N].
        force: (g, 3) [N].
        push: (g,) number of each group's push.

    Returns the exchanged pattern (g, 3) [N].
    """
    size = np.maximum(np.linalg.norm(force, axis=1), 1e-12)
    share = np.einsum("gi,gi->g", pattern, force) / size**2
    names = np.unique(push)
    moved = np.zeros_like(pattern)
    for place, name in enumerate(names):
        here, there = (
            np.flatnonzero(push == name),
            np.flatnonzero(push == names[(place + len(names) // 2) % len(names)]),
        )
        taken = there[np.minimum(np.arange(len(here)), len(there) - 1)]
        moved[here] = share[taken, None] * force[here]
    return moved
