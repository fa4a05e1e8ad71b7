"""A tool with friction, against Cattaneo's and Mindlin's solution and the laws of friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError, SolveError
from palpate.gradients.displacement_changes import displacement_changes
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import Equilibrium, Replay, replay, require_converged
from palpate.setup.setup import Box, Material, Setup, Support, Tool

RADIUS, NU, MODULUS = 5e-3, 0.45, 5e3
BLOCK = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=RADIUS), mass=0.104)
GRID = GridSpec(nodes=(13, 9, 7), spacing=1.5e-3)
TOP = BLOCK.geometry.size[2] + RADIUS


def _rough(friction: float, setup: Setup = BLOCK) -> Setup:
    return replace(setup, tool=replace(setup.tool, friction_coefficient=friction))


def _pushed(depth: float, ways: FloatArray, steps: int = 4) -> FloatArray:
    """Centres (f, 3) [m]: down in some steps, then sideways to each displacement."""
    down = [[0.0, 0.0, TOP - depth * share] for share in np.arange(1, steps + 1) / steps]
    return np.array([*down, *([way, 0.0, TOP - depth] for way in ways)])


@pytest.fixture(scope="module")
def partly_slipping() -> tuple[list[Equilibrium], FloatArray, float]:
    """A shallow dent in a large block, dragged sideways until it slips: frames, displacements [m],
    friction.
    """
    size, friction, ways = (0.06, 0.06, 0.05), 0.3, np.linspace(2.5e-5, 2e-4, 8)
    setup = Setup(
        geometry=Box(size=size),
        tool=Tool(radius=RADIUS, friction_coefficient=friction),
        material=Material(poisson_ratio=NU, young_modulus=MODULUS),
    )
    centres = _pushed(5e-4, ways)
    centres[:, 2] += size[2] - BLOCK.geometry.size[2]
    frames = replay(setup, centres, GridSpec(nodes=(17, 17, 13), spacing=2.5e-4, order=2))
    require_converged(frames)
    return frames, ways, friction


def test_sideways_force_is_cattaneos_and_mindlins(partly_slipping):
    """T / (mu N) = 1 - (1 - x)^(3/2), x = 16 G a w / (3 (2 - nu) mu N) (Johnson 1985, eq. 7.42).

    A grid that cannot resolve the traction's peak at the edge of the stick zone is some percent too
    soft.
    """
    frames, ways, friction = partly_slipping
    push, shear = frames[3].force[2], MODULUS / (2 * (1 + NU))
    wide = 16 * shear * np.sqrt(RADIUS * 5e-4) / (3 * (2 - NU) * friction * push)
    wanted = friction * push * (1 - (1 - np.minimum(wide * ways, 1.0)) ** 1.5)
    found = np.array([-frame.force[0] for frame in frames[4:]])
    assert (found < 1.01 * wanted).all() and (found > 0.86 * wanted).all()
    assert found[-1] == pytest.approx(wanted[-1], rel=0.03)


def test_drag_stays_below_the_friction_limit(partly_slipping):
    frames, _, friction = partly_slipping
    for frame in frames:
        assert np.hypot(frame.force[0], frame.force[1]) <= 1.001 * friction * frame.force[2]


def test_sticking_surface_moves_with_the_tool():
    grid = GridSpec(nodes=(13, 9, 7), spacing=1.5e-3, order=2)
    sticking, smooth = (
        replay(_rough(mu), _pushed(4e-3, np.array([5e-4, 1e-3])), grid) for mu in (5.0, 0.0)
    )
    require_converged(sticking)
    below = np.array([[0.0, 0.0, BLOCK.geometry.size[2]]])
    held = sticking[-1].move(below) - sticking[3].move(below)
    slid = smooth[-1].move(below) - smooth[3].move(below)
    assert held[0, 0] == pytest.approx(1e-3, abs=5e-5)
    assert abs(slid[0, 0]) < 3e-4


def test_zero_and_tiny_friction_agree_with_the_plain_replay():
    way = _pushed(4e-3, np.array([1e-3]))
    plain, traced = replay(BLOCK, way, GRID), replay(_rough(1e-6), way, GRID)
    for frame, other in zip(plain, traced, strict=True):
        assert frame.friction_history is None and other.friction_history is not None
        assert np.abs(frame.displacement - other.displacement).max() < 1e-7


def test_drag_out_and_back_dissipates_work():
    way = _pushed(4e-3, np.array([1e-3, 2e-3, 1e-3, 0.0, -1e-3, -2e-3, -1e-3, 0.0]))

    def work(friction: float) -> float:
        frames = replay(_rough(friction), way, GRID)
        require_converged(frames)
        loop = [frames[3 + index] for index in range(9)]
        pull = np.array([-frame.force[0] for frame in loop])
        return float(
            (0.5 * (pull[1:] + pull[:-1]) * np.diff([frame.tool.centre[0] for frame in loop])).sum()
        )

    force = replay(BLOCK, way, GRID)[3].force[2]
    assert abs(work(0.0)) < 0.02 * force * 1e-3
    assert work(0.3) > 0.2 * force * 1e-3


def test_result_depends_on_the_path_but_not_on_the_number_of_frames():
    aside = np.array([2e-3, 0.0, TOP - 4e-3])
    coarse = replay(_rough(0.5), np.array([[0.0, 0.0, TOP - 4e-3], aside]), GRID)
    fine = replay(_rough(0.5), _pushed(4e-3, np.linspace(0.25e-3, 2e-3, 8), steps=8), GRID)
    straight = replay(_rough(0.5), np.array([aside]), GRID)
    require_converged([*coarse, *fine, *straight])
    assert np.allclose(coarse[-1].force, fine[-1].force, atol=0.03 * fine[-1].force[2])
    assert np.linalg.norm(straight[-1].force - fine[-1].force) > 0.1 * fine[-1].force[2]


def test_replay_continues_from_a_frame():
    way = _pushed(4e-3, np.array([1e-3, 2e-3]))
    whole = replay(_rough(0.5), way, GRID)
    rest = Replay(_rough(0.5), GRID).step(way[-1], whole[-2])
    assert np.allclose(rest.displacement, whole[-1].displacement, atol=2e-7)


def test_failed_frame_keeps_the_last_friction_history():
    way = _pushed(4e-3, np.array([1e-3, 2e-3]))
    broken = np.insert(way, 5, [0.0, 0.0, 0.01], axis=0)  # the centre deep inside the block
    frames = replay(_rough(0.5), broken, GRID)
    assert frames[5].outcome is not Outcome.CONVERGED
    assert frames[6].outcome is Outcome.CONVERGED
    wanted = replay(_rough(0.5), way, GRID)[-1]
    assert np.allclose(frames[6].displacement, wanted.displacement, atol=2e-6)


def test_functions_of_single_frames_refuse_friction():
    frames = replay(_rough(0.5), _pushed(2e-3, np.array([])), GRID)
    with pytest.raises(SolveError, match="order of time"):
        replay(_rough(0.5), _pushed(2e-3, np.array([])), GRID, starts=frames)
    with pytest.raises(SetupError, match="those before"):
        displacement_changes(Replay(_rough(0.5), GRID), frames[-1], [(_rough(0.6), np.zeros(3))])


def test_rough_ball_drags_a_slipping_block_along():
    loose = replace(_rough(0.8), support=Support(friction_coefficient=0.05))
    frames = replay(loose, _pushed(3e-3, np.array([2e-3, 4e-3])), GRID)
    require_converged(frames)
    smooth = replay(replace(loose, tool=BLOCK.tool), _pushed(3e-3, np.array([2e-3, 4e-3])), GRID)
    assert frames[-1].slip[0] > smooth[-1].slip[0] + 5e-4
