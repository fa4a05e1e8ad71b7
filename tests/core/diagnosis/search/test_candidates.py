from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, SETUP, SIZE, observed, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.search.signatures import replayed_signatures, updated_signatures
from palpate.effects.load import Gravity
from palpate.effects.support import BaseSlip
from palpate.effects.tool import ToolRadius
from palpate.mesh.box_mesh import GridSpec

GRID, FINE = GridSpec(nodes=(9, 7, 6), spacing=2e-3), GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
STATED = replace(SETUP, landmarks=CORNERS)
WEIGHT, SLIDING = Gravity(specific_weight_over_stiffness=1.5), BaseSlip(friction_coefficient=0.1)
THICK = ToolRadius(radius=2 * STATED.tool.radius)


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    beside = SIZE[0] / 2 + STATED.tool.radius
    centres = np.array(
        [[beside + 6e-3, 0.0, 0.024], [beside - 3e-3, 0.0, 0.024], [beside - 6e-3, 0.0, 0.024]]
    )
    data = [replace(observed(STATED, centres, noise=3e-4, seed=0), name="poke-01")]
    with Workers(data, 1) as workers:
        yield evaluator_of(STATED, registration(), workers, ["poke-01"], None, GRID, FINE)


@pytest.fixture(scope="module")
def origin(evaluator: Evaluator) -> Model:
    return evaluator.evaluate(())


@pytest.mark.parametrize(
    ("there", "added"), [(SLIDING, WEIGHT), (WEIGHT, SLIDING), (THICK, WEIGHT)]
)
def test_gravity_and_what_depends_on_it_are_weighed_anew_on_top_of_each_other(
    evaluator: Evaluator, origin: Model, there, added
):
    finite = replayed_signatures(evaluator, origin, [there, added], origin)
    model = evaluator.evaluate([there], origin.predictions)
    both = evaluator.evaluate([there, added], model.predictions)
    true = both.predictions[0].change_from(model.predictions[0])[0]
    (kept, same), (effect, anew) = updated_signatures(evaluator, model, finite, origin)
    assert (kept, effect) == (there, added) and same is finite[0][1]
    stale, fresh = (one[0].change_from(origin.predictions[0])[0] for one in (finite[1][1], anew))
    assert np.linalg.norm(fresh - true) < 0.05 * np.linalg.norm(true)
    assert np.linalg.norm(stale - true) > 0.15 * np.linalg.norm(true)


def test_where_nothing_was_found_signatures_stay_what_they_are(evaluator: Evaluator, origin: Model):
    finite = replayed_signatures(evaluator, origin, [WEIGHT, SLIDING], origin)
    assert [one for _, one in updated_signatures(evaluator, origin, finite, origin)] == [
        one for _, one in finite
    ]
