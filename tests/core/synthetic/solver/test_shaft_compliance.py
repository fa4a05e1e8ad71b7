"""A tool with a compliant shaft on the virtual bench."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from virtual_push import hide, simulate_push

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.bench.sequence_recording import scene_at
from palpate.synthetic.bench.solved_track import SolvedTrack
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.shaft_compliance import PLACED, solve_compliant_shaft
from palpate.synthetic.solver.tet_equilibrium import TetState

C_TIMES_E = 30.0
SOFTNESS = C_TIMES_E / Scenario().young_modulus


@pytest.fixture(scope="module")
def given() -> SolvedTrack:
    return simulate_push(hide("tool_compliance", compliance_times_stiffness=C_TIMES_E), side=True)


def test_tool_stands_where_its_load_puts_it(given: SolvedTrack) -> None:
    deepest = given.solved_pushes[0].segments[0].key_frames[-1]
    assert np.linalg.norm(deepest.deflection) > 0.3e-3
    assert deepest.deflection[1] > 0
    for key_frame in given.key_frames:
        assert key_frame.deflection == pytest.approx(
            -SOFTNESS * key_frame.tool_force, abs=2 * PLACED
        )


def test_tool_pushes_as_a_stiff_one_stated_where_it_came_to_be(given: SolvedTrack) -> None:
    deepest = given.solved_pushes[0].segments[0].key_frames[-1]
    x, y, z = (float(part) for part in deepest.deflection)
    stiff = (
        simulate_push(hide("tool_offset", dx=x, dy=y, dz=z), side=True)
        .solved_pushes[0]
        .segments[0]
        .key_frames[-1]
    )
    assert deepest.tool_force == pytest.approx(
        stiff.tool_force, abs=5e-3 * float(np.linalg.norm(stiff.tool_force))
    )


def test_tool_is_back_where_it_is_stated_once_it_is_free(given: SolvedTrack) -> None:
    solved = given.solved_pushes[0]
    assert solved.deflection(0.5) == pytest.approx(np.zeros(3), abs=1e-12)
    assert solved.deflection(2.5) == pytest.approx(solved.segments[0].key_frames[-1].deflection)
    assert solved.deflection(4.5) == pytest.approx(np.zeros(3), abs=1e-12)
    assert 0 < solved.deflection(1.8)[1] < solved.deflection(2.5)[1]


def test_camera_sees_the_tool_where_it_truly_is(given: SolvedTrack) -> None:
    effects = (hide("tool_compliance", compliance_times_stiffness=C_TIMES_E),)
    job: Any = SimpleNamespace(scenario=Scenario(effects=effects), motion=given.motion)
    stated, true = given.motion.centre(np.array([2.5]))[0], scene_at(job, given, 2.5).centre
    assert true is not None
    assert true - stated == pytest.approx(given.solved_pushes[0].deflection(2.5))
    assert np.linalg.norm(true - stated) > 0.3e-3


def test_friction_holds_the_base_under_a_tool_that_gives_way() -> None:
    giving, slip = (
        hide("tool_compliance", compliance_times_stiffness=20.0),
        hide("base_slip", friction_coefficient=0.08),
    )
    track = simulate_push(giving, slip, side=True)
    weight = Scenario().mass * 9.81
    assert track.key_frames[-1].slip[1] < -0.2e-3
    for key_frame in track.key_frames:
        assert (
            np.linalg.norm(key_frame.tool_force[:2])
            <= 0.08 * (weight - key_frame.tool_force[2]) * 1.001
        )


def _block_of_springs(stiffness: FloatArray, place: FloatArray) -> TetState:
    """A block that answers a motion of the tool from nought linearly."""
    return TetState(np.zeros((1, 3)), place, stiffness @ place, stiffness, 0.0)


def test_place_is_that_of_two_springs_in_a_row() -> None:
    stiffness, stated = np.diag([40.0, 90.0, 0.0]), np.array([1e-3, -2e-3, 3e-3])
    state = solve_compliant_shaft(
        stated, 0.02, stated, lambda place: _block_of_springs(stiffness, place)
    )
    assert state.centre == pytest.approx(stated / (1 + 0.02 * np.diag(stiffness)), abs=1e-9)
    assert np.diag(state.contact_stiffness) == pytest.approx(
        np.diag(stiffness) / (1 + 0.02 * np.diag(stiffness))
    )


def test_tool_that_finds_no_rest_says_how_far_it_is_from_it() -> None:
    def unsteady(place: FloatArray) -> TetState:
        return TetState(
            np.zeros((1, 3)), place, 1e-1 * np.sign(place - 1e-3), np.zeros((3, 3)), 0.0
        )

    with pytest.raises(SolveError, match=r"no rest on its shaft: it stands .* mm from"):
        solve_compliant_shaft(np.full(3, 1e-3), 0.02, np.zeros(3), unsteady)
