from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from pushed_block import CORNERS, SETUP, SIZE, observed, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.search.candidates import _replayed, renewed
from palpate.effects.load import Gravity
from palpate.effects.support import BaseSlip
from palpate.effects.tool import ToolRadius
from palpate.mesh.box_mesh import GridSpec

GRID, FINE = GridSpec(nodes=(9, 7, 6), spacing=2e-3), GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
STATED = replace(SETUP, landmarks=CORNERS)
WEIGHT, SLIDING = Gravity(specific_weight_over_stiffness=1.5), BaseSlip(friction_coefficient=0.1)
THICK = ToolRadius(radius=2 * STATED.tool.radius)


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    beside = SIZE[0] / 2 + STATED.tool.radius
    centres = np.array(
        [[beside + 6e-3, 0.0, 0.024], [beside - 3e-3, 0.0, 0.024], [beside - 6e-3, 0.0, 0.024]]
    )
    data = [replace(observed(STATED, centres, noise=3e-4, seed=0), name="poke-01")]
    with Workers(data, 1) as workers:
        yield Bench(STATED, registration(), workers, ["poke-01"], None, GRID, FINE)


@pytest.fixture(scope="module")
def origin(bench: Bench) -> Model:
    return bench.evaluate(())


@pytest.mark.parametrize(
    ("there", "added"), [(SLIDING, WEIGHT), (WEIGHT, SLIDING), (THICK, WEIGHT)]
)
def test_weight_and_what_hangs_on_it_are_weighed_anew_on_top_of_each_other(
    bench: Bench, origin: Model, there, added
):
    finite = _replayed(bench, origin, [there, added], origin)
    model = bench.evaluate([there], origin.predictions)
    both = bench.evaluate([there, added], model.predictions)
    true = both.predictions[0].change_from(model.predictions[0])[0]
    (kept, same), (effect, anew) = renewed(bench, model, finite, origin)
    assert (kept, effect) == (there, added) and same is finite[0][1]
    stale, fresh = (one[0].change_from(origin.predictions[0])[0] for one in (finite[1][1], anew))
    assert np.linalg.norm(fresh - true) < 0.05 * np.linalg.norm(true)
    assert np.linalg.norm(stale - true) > 0.15 * np.linalg.norm(true)


def test_where_nothing_was_found_signatures_stay_what_they_are(bench: Bench, origin: Model):
    finite = _replayed(bench, origin, [WEIGHT, SLIDING], origin)
    assert [one for _, one in renewed(bench, origin, finite, origin)] == [one for _, one in finite]
