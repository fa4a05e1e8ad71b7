"""A tool that gives way on the virtual bench."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from virtual_push import hide, push

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.bench.solved_track import Track
from palpate.synthetic.make_dataset import _scene
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.shaft_compliance import PLACED, give_way
from palpate.synthetic.solver.tet_equilibrium import State

C_TIMES_E = 30.0
SOFTNESS = C_TIMES_E / Scenario().young_modulus


@pytest.fixture(scope="module")
def given() -> Track:
    return push(hide("tool_compliance", compliance_times_stiffness=C_TIMES_E), side=True)


def test_tool_stands_where_its_load_puts_it(given: Track) -> None:
    deepest = given.stretches[0].passages[0].moments[-1]
    assert np.linalg.norm(deepest.deflection) > 0.3e-3
    assert deepest.deflection[1] > 0
    for moment in given.moments:
        assert moment.deflection == pytest.approx(-SOFTNESS * moment.push, abs=2 * PLACED)


def test_tool_pushes_as_a_stiff_one_stated_where_it_came_to_be(given: Track) -> None:
    deepest = given.stretches[0].passages[0].moments[-1]
    x, y, z = (float(part) for part in deepest.deflection)
    stiff = (
        push(hide("tool_offset", dx=x, dy=y, dz=z), side=True).stretches[0].passages[0].moments[-1]
    )
    assert deepest.push == pytest.approx(stiff.push, abs=5e-3 * float(np.linalg.norm(stiff.push)))


def test_tool_is_back_where_it_is_stated_once_it_is_free(given: Track) -> None:
    stretch = given.stretches[0]
    assert stretch.deflection(0.5) == pytest.approx(np.zeros(3), abs=1e-12)
    assert stretch.deflection(2.5) == pytest.approx(stretch.passages[0].moments[-1].deflection)
    assert stretch.deflection(4.5) == pytest.approx(np.zeros(3), abs=1e-12)
    assert 0 < stretch.deflection(1.8)[1] < stretch.deflection(2.5)[1]


def test_camera_sees_the_tool_where_it_truly_is(given: Track) -> None:
    effects = (hide("tool_compliance", compliance_times_stiffness=C_TIMES_E),)
    job: Any = SimpleNamespace(scenario=Scenario(effects=effects), motion=given.motion)
    stated, true = given.motion.centre(np.array([2.5]))[0], _scene(job, given, 2.5).centre
    assert true is not None
    assert true - stated == pytest.approx(given.stretches[0].deflection(2.5))
    assert np.linalg.norm(true - stated) > 0.3e-3


def test_friction_holds_the_base_under_a_tool_that_gives_way() -> None:
    giving, slip = (
        hide("tool_compliance", compliance_times_stiffness=20.0),
        hide("base_slip", friction_coefficient=0.08),
    )
    track = push(giving, slip, side=True)
    weight = Scenario().mass * 9.81
    assert track.moments[-1].slip[1] < -0.2e-3
    for moment in track.moments:
        assert np.linalg.norm(moment.push[:2]) <= 0.08 * (weight - moment.push[2]) * 1.001


def _block_of_springs(stiffness: FloatArray, place: FloatArray) -> State:
    """A block that answers a motion of the tool from nought linearly."""
    return State(np.zeros((1, 3)), place, stiffness @ place, stiffness, 0.0)


def test_place_is_that_of_two_springs_in_a_row() -> None:
    stiffness, stated = np.diag([40.0, 90.0, 0.0]), np.array([1e-3, -2e-3, 3e-3])
    state = give_way(stated, 0.02, stated, lambda place: _block_of_springs(stiffness, place))
    assert state.centre == pytest.approx(stated / (1 + 0.02 * np.diag(stiffness)), abs=1e-9)
    assert np.diag(state.compliance) == pytest.approx(
        np.diag(stiffness) / (1 + 0.02 * np.diag(stiffness))
    )


def test_tool_that_finds_no_rest_says_how_far_it_is_from_it() -> None:
    def unsteady(place: FloatArray) -> State:
        return State(np.zeros((1, 3)), place, 1e-1 * np.sign(place - 1e-3), np.zeros((3, 3)), 0.0)

    with pytest.raises(SolveError, match=r"no rest on its shaft: it stands .* mm from"):
        give_way(np.full(3, 1e-3), 0.02, np.zeros(3), unsteady)
