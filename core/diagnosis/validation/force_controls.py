"""The control of a cause that only forces tell of: with the pushes' places exchanged it must lose
its gain.

As in `palpate.diagnosis.validation.negative_controls`, what the model without the cause leaves
stays as it was measured, and the cause's pattern is put elsewhere. A pattern of forces is one
number for each push, by which share the cause changes its force; these shares are handed on from
push to push, half way round the sequence. No replay is needed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.noise_model import rows_of
from palpate.diagnosis.validation.negative_controls import Control, judge
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["EXCHANGED", "exchanged", "force_controls"]

EXCHANGED = "pushes exchanged"


def force_controls(bench: Bench, model: Model, baseline: Model) -> tuple[Control, ...]:
    """Every cause of an accepted model, on sequences without clouds."""
    found = []
    first = len(bench.nuisances.precision) - 1
    for index, left in enumerate(model.effects):
        others = [effect for number, effect in enumerate(model.effects) if number != index]
        origin: Sequence[Prediction] = baseline.predictions
        if others:
            origin = [future.result() for future in bench.predict(others, None, model.predictions)]
        blocks = []
        for noise, before, after in zip(bench.noises, origin, model.predictions, strict=True):
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
            blocks.append(Block(block.name, block.gram / bench.temperature, block.values))
        found += judge(bench, blocks, left, (EXCHANGED,))
    return tuple(found)


def exchanged(pattern: FloatArray, force: FloatArray, push: IntArray) -> FloatArray:
    """The pattern (g, 3) [N], as a share of each force (g, 3) [N], at the push half way round the
    sequence.

    A push's groups are taken in their order; where one has fewer, its last stands for those
    missing.
    """
    size = np.maximum(np.linalg.norm(force, axis=1), 1e-12)
    share = np.einsum("gi,gi->g", pattern, force) / size**2
    names = np.unique(push)
    found = np.zeros_like(pattern)
    for place, name in enumerate(names):
        here, there = (
            np.flatnonzero(push == name),
            np.flatnonzero(push == names[(place + len(names) // 2) % len(names)]),
        )
        taken = there[np.minimum(np.arange(len(here)), len(there) - 1)]
        found[here] = share[taken, None] * force[here]
    return found
