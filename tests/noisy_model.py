"""Models whose blocks are noise, for what reads numbers off a fit without replaying anything."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from evaluating import evaluator_of
from pushed_block import SETUP, prediction, registration

from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.effects import Effect
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.tool import ToolRadius
from palpate.mesh.box_mesh import GridSpec

NUISANCES = TOOL_COLUMNS + 9
GROUPS = 4
LUMP = StiffInclusion(x=0.01, y=-0.002, z=0.024, radius=6e-3, stiffness_ratio=4.0)
RADIUS = ToolRadius(radius=4.4e-3)


@contextmanager
def stated_evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed."""
    with Workers([], 1) as workers:
        yield evaluator_of(
            SETUP, registration(), workers, ["poke-01"], None, GridSpec(), GridSpec()
        )


def noisy_model(evaluator: Evaluator, *effects: Effect, seed: int = 0) -> Model:
    """A model whose blocks are noise with sizeable columns."""
    random = np.random.default_rng(seed)
    own = sum(len(effect.numbers()) for effect in effects)
    scales = np.array([item.scale for effect in effects for item in effect.numbers()])
    shape = (GROUPS, evaluator.problem.surface.patches)
    size = np.concatenate([np.full(NUISANCES - 1, 1e-4), 1e-5 / scales, [1e-5]])
    columns = size * random.standard_normal((*shape, NUISANCES + own))
    gap = 1e-4 * random.standard_normal(shape)
    gap[:, :3] = np.nan
    weights = np.where(np.isfinite(gap), 1e8, 0.0)
    setup = SETUP
    for effect in effects:
        setup = effect.apply(setup)
    blocks = [
        Block("poke-01", *gram(gap, columns, weights)),
        Block("poke-02", *gram(2 * gap, columns, weights)),
    ]
    at = NUISANCES - 1
    return Model(
        effects,
        setup,
        (prediction(gap),),
        tuple(blocks),
        ModelColumns((*range(at), at + own), tuple(range(at, at + own))),
    )
