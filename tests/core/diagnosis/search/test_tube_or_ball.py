"""A tube and a ball are told apart by a search that has both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, SETUP, observed, poke, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.report.report import verdict_of
from palpate.diagnosis.search.forward_selection import search
from palpate.diagnosis.search.screening import Candidate
from palpate.diagnosis.search.shortlist import shortlist
from palpate.effects import Anisotropy, Effect, StiffInclusion, StiffTube
from palpate.mesh.box_mesh import GridSpec

GRID, FINE = GridSpec(nodes=(9, 7, 6), spacing=2e-3), GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
STATED = replace(SETUP, landmarks=CORNERS)
PLACES = {
    "poke-01": [(-0.018, -0.004), (0.004, 0.006)],
    "poke-02": [(-0.006, 0.003), (0.016, 0.002)],
    "poke-03": [(0.0, -0.006), (0.022, 0.007)],
}
BALL = StiffInclusion(x=4e-3, y=2e-3, z=0.0245, radius=7e-3, stiffness_ratio=6.0)
TUBE = StiffTube(
    aside=2e-3,
    z=0.026,
    heading=0.3,
    inclination=0.0,
    bend=4.0,
    sag=0.0,
    radius=4.5e-3,
    stiffness_ratio=8.0,
)


@pytest.mark.more
@pytest.mark.parametrize("truth", [BALL, TUBE], ids=["ball", "tube"])
def test_the_inclusion_that_is_there_is_named(truth: Effect) -> None:
    data = []
    for seed, (name, places) in enumerate(PLACES.items()):
        centres = np.array([poke(depth, x, y) for x, y in places for depth in (-6e-3, 3e-3, 5e-3)])
        item = observed(truth.apply(STATED), centres, noise=2e-4, seed=10 * seed)
        data.append(replace(item, name=name))
    with Workers(data, 1) as workers:
        evaluator = evaluator_of(
            STATED,
            registration(),
            workers,
            list(PLACES),
            None,
            GRID,
            FINE,
            catalogue=[StiffInclusion, StiffTube, Anisotropy],
        )
        findings = search(evaluator, 0)
    assert findings.best is not None and verdict_of(findings) == "found"
    (found,) = findings.best.model.effects
    assert type(found) is type(truth)
    assert {trial.model.names for trial in findings.trials} >= {("stiff_inclusion",)}
    if isinstance(found, StiffTube):
        line, true = (np.array(one.located(STATED)["polyline"]) for one in (found, truth))
        apart = np.linalg.norm(line[:, None] - true[None], axis=2).min(axis=0)
        assert np.mean(apart < 3e-3) >= 0.8


def test_tube_behind_a_ball_waits_until_the_ball_is_fitted() -> None:
    ball = Candidate(start=replace(BALL, stiffness_ratio=1.0), of=("stiffness_ratio",))
    tube = Candidate(start=replace(TUBE, stiffness_ratio=1.0), of=("stiffness_ratio",))
    fibres = Candidate(start=Anisotropy.neutral(SETUP), of=("stiffness_ratio",))
    both = [ball, tube, fibres]
    assert shortlist(np.array([50.0, 40.0, 30.0]), both, 10.0) == [ball, fibres]
    assert shortlist(np.array([40.0, 50.0, 30.0]), both, 10.0) == [tube, ball, fibres]
