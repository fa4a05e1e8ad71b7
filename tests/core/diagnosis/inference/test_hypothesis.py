from __future__ import annotations

import numpy as np
import pytest
from pushed_block import SETUP, registration

from palpate.diagnosis.inference.evidence import Block, fit, gram, log_evidence
from palpate.diagnosis.inference.nuisances import Nuisances
from palpate.effects.load import Gravity
from palpate.effects.sensor import CameraRegistration
from palpate.effects.tool import ToolOffset

SHIFT = 1.5e-3


def _seen(own: int, share: float) -> Block:
    """What is left of a shift along one nuisance's column when the model has a share of it already;
    the effect's column is last.
    """
    random = np.random.default_rng(0)
    columns = random.standard_normal((20, 30, 15))
    columns = np.concatenate([columns, columns[..., own : own + 1]], axis=2)
    residual = -(1 - share) * SHIFT * columns[..., own] + 1e-4 * random.standard_normal((20, 30))
    matrix, values = gram(residual, columns, np.full((20, 30), 1e8))
    return Block("poke", matrix, values)


@pytest.mark.parametrize("effect", [CameraRegistration.neutral(SETUP), ToolOffset.neutral(SETUP)])
def test_effect_takes_all_that_it_and_its_twin_do(effect):
    nuisances = Nuisances.of(registration())
    own = nuisances.blocks.places(effect.nuisance)[0]
    precision = np.zeros((16, 16))
    precision[15, 15] = 4e-3**-2
    for kept, there in ((nuisances.with_effects([effect]), SHIFT), (nuisances.precision, None)):
        precision[:15, :15] = kept
        change = fit([_seen(own, 0.0)], list(range(16)), precision).change
        if there:
            assert change[15] == pytest.approx(there, rel=0.02) and abs(change[own]) < 1e-6
        assert change[15] + change[own] == pytest.approx(SHIFT, rel=0.02)


def test_evidence_asks_for_the_whole_shift_where_the_twin_takes_none():
    nuisances = Nuisances.of(registration())
    own = nuisances.blocks.places(CameraRegistration.nuisance)[0]
    less, all_of_it = (_seen(own, share) for share in (0.7, 1.0))

    def price(precision: np.ndarray) -> float:
        return log_evidence([all_of_it], list(range(15)), precision) - log_evidence(
            [less], list(range(15)), precision
        )

    assert (
        price(nuisances.with_effects([CameraRegistration.neutral(SETUP)]))
        > 50 * price(nuisances.precision)
        > 0
    )


def test_other_nuisances_stay_as_stated():
    nuisances = Nuisances.of(registration())
    assert np.array_equal(
        nuisances.with_effects([Gravity(specific_weight_over_stiffness=2.0)]), nuisances.precision
    )
    pinned = nuisances.with_effects([ToolOffset.neutral(SETUP)]) != nuisances.precision
    assert np.array_equal(np.argwhere(pinned), [[0, 0], [1, 1], [2, 2]])
