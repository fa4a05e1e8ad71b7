"""A free map of the stiffness, from replays: a body with a stiff and a soft lump, and a uniform
one.

No effect of the catalogue has two lumps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import SETUP, SIZE, observed, poke, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.report.stiffness.map_report import map_to_json
from palpate.diagnosis.report.stiffness.stiffness_map import StiffnessMap, stiffness_map
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.setup.setup import Inclusion, Setup

GRID, FINE = GridSpec(nodes=(9, 7, 6), spacing=2e-3), GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
STIFF = Inclusion(x=-4e-3, y=0.0, z=0.0255, radius=7e-3, stiffness_ratio=6.0)
SOFT = Inclusion(x=16e-3, y=0.0, z=0.0255, radius=7e-3, stiffness_ratio=0.2)
PLACES = {
    "poke-01": [(-6e-3, -4e-3), (12e-3, 3e-3)],
    "poke-02": [(-3e-3, 5e-3), (17e-3, -4e-3)],
    "poke-03": [(4e-3, 0.0), (22e-3, 2e-3)],
}


def mapped(truth: Setup) -> StiffnessMap:
    """The map of a block that behaves like `truth`, beside no cause at all."""
    data = []
    for seed, (name, places) in enumerate(PLACES.items()):
        centres = np.array([poke(depth, x, y) for x, y in places for depth in (-6e-3, 5e-3)])
        item = observed(truth, centres, noise=2e-4, seed=10 * seed)
        data.append(replace(item, name=name))
    touched = np.array([(x, y, SIZE[2]) for places in PLACES.values() for x, y in places])
    with Workers(data, 1) as workers:
        evaluator = evaluator_of(SETUP, registration(), workers, list(PLACES), None, GRID, FINE)
        up = np.tile((0.0, 0.0, 1.0), (len(touched), 1))
        evaluator.problem = replace(evaluator.problem, contacts=(touched, up))
        baseline = evaluator.baseline((), inclusion_places(evaluator.problem))
        made = stiffness_map(evaluator, data, baseline, 0)
    assert made is not None
    return made


def log_stiffness(places: FloatArray, edge: float) -> FloatArray:
    """Logarithm (n,) of the true stiffness, averaged over cells of this edge [m]."""
    total = np.zeros(len(places))
    for lump in (STIFF, SOFT):
        away = np.linalg.norm(places - (lump.x, lump.y, lump.z), axis=1)
        total += np.log(lump.stiffness_ratio) * np.clip(0.5 + (lump.radius - away) / edge, 0, 1)
    return total


@pytest.mark.more
def test_map_shows_a_stiff_and_a_soft_lump_and_what_was_not_touched() -> None:
    lumps = replace(SETUP.material, inclusions=(STIFF, SOFT))
    made = mapped(replace(SETUP, material=lumps))
    inside, report = made.inside, map_to_json(made)
    truth = log_stiffness(inside.places, made.cells.spacing)
    ratio, low, high = inside.ends
    trusted = inside.trusted
    assert made.structured and report["structured"]
    assert np.corrcoef(truth[trusted], np.log(ratio[trusted]))[0, 1] > 0.75
    within = (low < np.exp(truth)) & (np.exp(truth) < high)
    assert within[trusted].mean() > 0.9
    assert not trusted[inside.places[:, 0] < -0.025].any() and "-x" in report["unfelt_ends"]
    stiffest = max(report["parts"], key=lambda part: part["ratio"])
    assert np.linalg.norm(np.subtract(stiffest["at"], (STIFF.x, STIFF.y, STIFF.z))) < 8e-3
    assert {1, 3} <= set(stiffest["pushes"]) and not {2, 4, 6} & set(stiffest["pushes"])
    softest = min(report["parts"], key=lambda part: part["ratio"])
    assert np.linalg.norm(np.subtract(softest["at"], (SOFT.x, SOFT.y, SOFT.z))) < 8e-3
    assert softest["high"] < 1.0 < stiffest["low"] and set(softest["pushes"]) == {2, 4, 6}


@pytest.mark.more
def test_uniform_body_has_a_flat_map_that_is_left_out() -> None:
    made = mapped(SETUP)
    ratio, low, high = made.inside.ends
    assert ((low < 1) & (1 < high)).mean() > 0.95
    assert np.abs(ratio - 1).max() < 0.1
    report = map_to_json(made)
    assert not report["structured"] and "noise" in report["why_not"]
    assert report["points"] == report["surface"] == report["parts"] == report["pushes"] == []
