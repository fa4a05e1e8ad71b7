"""The extended model has the fitted nuisances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import GRID, SETUP, observed, poke, registration

from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.gain.held_out_gain import _begun
from palpate.diagnosis.gain.tuned_setup import tuned_setup
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.effects.elastic_material import YoungModulus
from palpate.mesh.box_mesh import GridSpec
from palpate.registration.pose import small_motion
from palpate.setup.setup import Material

NUISANCES = TOOL_COLUMNS + 9
OFF = np.array([2e-4, -1e-4, 1.5e-4, 2e-3, -1e-3, 3e-3])
"""How far the robot is off, and below its tool's radius [m] and the material's nu."""
RADIUS, NU = 4e-5, -6e-3


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield evaluator_of(
            SETUP, registration(), workers, ["poke-01"], None, GridSpec(), GridSpec()
        )


def _shown(evaluator: Evaluator, *true: float) -> Model:
    """A model without causes, and clean data of which the first nuisances are true by so much."""
    random, shape = np.random.default_rng(3), (4, evaluator.problem.surface.patches)
    columns = random.standard_normal((*shape, NUISANCES))
    gap = -columns[..., : len(true)] @ np.array(true)
    block = Block("poke-01", *gram(gap, columns, np.full(shape, 1e14)))
    return Model((), SETUP, (), (block,), ModelColumns(tuple(range(NUISANCES))))


def test_robot_pose_radius_and_nu_are_fitted(evaluator: Evaluator) -> None:
    found = tuned_setup(evaluator, _shown(evaluator, *OFF, RADIUS, NU))
    true = small_motion(OFF, evaluator.problem.registration.robot_pivot) @ SETUP.phantom_from_robot
    assert found.phantom_from_robot.matrix == pytest.approx(true.matrix, abs=1e-6)
    assert found.tool.radius == pytest.approx(SETUP.tool.radius + RADIUS, abs=1e-7)
    assert found.material.poisson_ratio == pytest.approx(
        SETUP.material.poisson_ratio + NU, abs=1e-5
    )
    assert found.phantom_from_camera.matrix == pytest.approx(SETUP.phantom_from_camera.matrix)


def test_fitted_poisson_ratio_stays_within_its_bounds(evaluator: Evaluator) -> None:
    found = tuned_setup(evaluator, _shown(evaluator, *np.zeros(6), 0.0, 0.2))
    assert found.material.poisson_ratio == 0.495
    assert found.material.young_modulus == YoungModulus.neutral(SETUP).E


def test_data_without_deviation_leave_the_setup_unchanged(evaluator: Evaluator) -> None:
    found = tuned_setup(evaluator, _shown(evaluator, 0.0))
    assert found.phantom_from_robot.matrix == pytest.approx(
        SETUP.phantom_from_robot.matrix, abs=1e-12
    )
    assert found.tool.radius == pytest.approx(SETUP.tool.radius)


def test_each_sequence_starts_from_its_own_first_replay() -> None:
    ways = {"short": [poke(2e-3)], "long": [poke(depth) for depth in (1e-3, 2e-3, 3e-3, 4e-3)]}
    data = [
        replace(observed(SETUP, np.array(way), count=2000), name=name) for name, way in ways.items()
    ]
    softer = replace(SETUP, material=Material(poisson_ratio=0.35))
    names = [item.name for item in data]
    with Workers(data, 2) as pool:
        plain, (under, again) = _begun(pool, names, [SETUP, softer, SETUP], GRID)
        led = [pending.result() for pending in under]
        same = [pending.result() for pending in again]
        wanted = [pending.result() for pending in pool.submit(names, softer, GRID, None, plain)]
        alone, none = _begun(pool, names, [SETUP], GRID)
    assert [item.name for item in plain] == [item.name for item in led] == names and none == []
    for one, other in ((led, wanted), (plain, alone)):
        assert all(
            np.array_equal(a.gap, b.gap, equal_nan=True) for a, b in zip(one, other, strict=True)
        )
    assert all(np.nanmax(np.abs(a.gap - b.gap)) < 1e-6 for a, b in zip(same, plain, strict=True))
    assert all(np.nanmax(np.abs(a.gap - b.gap)) > 1e-5 for a, b in zip(led, plain, strict=True))
