"""Effects with a history mean the same on the virtual bench and in the engine: both push one
block and agree.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from virtual_push import X, Y, Z, hide

from palpate.effects import from_json
from palpate.foundation.arrays import FloatArray
from palpate.mesh.graded_mesh import REPLAY_GRID
from palpate.replay.replay import Equilibrium, replay, require_converged
from palpate.setup.setup import Box, Material, Setup, Tool
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush
from palpate.synthetic.bench.solved_track import SolvedPush
from palpate.synthetic.bench.virtual_experiment import solve_motion
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.inelastic_history import InelasticHistory
from palpate.synthetic.solver.mooney_rivlin import constants, solid_energy
from palpate.synthetic.solver.rest_metric import assemble_metric, isochoric, metric_energy
from palpate.synthetic.solver.tet_block import TetGrading, mesh_block

RADIUS = Scenario().tool_radius
DEPTH, CLEAR, AWAY, END = 5e-3, 2e-3, np.array([0.0, 0.0, -1.0]), 5.5
DELAYED = hide("viscoelasticity", relaxed_fraction=0.5, time_constant=0.8)
KEPT = hide("permanent_set", retained_fraction=0.2)
ROUGH = hide("tool_friction", friction_coefficient=0.5)


def _poke() -> MotionPlan:
    """In one second, held for another, and back."""
    way = np.array([[4e-3, 2e-3, Z + RADIUS + CLEAR], [4e-3, 2e-3, Z + RADIUS - DEPTH]])
    length = CLEAR + DEPTH
    push = PlannedPush(way, np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.0, length, length, 0.0]))
    return MotionPlan("poke-top-01", AWAY, (push,), END)


def _drag() -> MotionPlan:
    """Down by 4 mm, 8 mm along x, and up where it went down."""
    low = Z + RADIUS - 4e-3
    way = np.array([[-4e-3, 2e-3, low + 6e-3], [-4e-3, 2e-3, low], [4e-3, 2e-3, low]])
    push = PlannedPush(
        way, np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([0.0, 6e-3, 14e-3, 6e-3, 0.0])
    )
    return MotionPlan("drag-01", AWAY, (push,), END)


def _made(motion: MotionPlan, *effects: HiddenEffect) -> SolvedPush:
    return solve_motion(Scenario(effects=effects), motion, 2.6e-3).solved_pushes[0]


def _replayed(motion: MotionPlan, looks: list[float], *effects: HiddenEffect) -> list[Equilibrium]:
    """Frames at these instants [s], of a replay that is led along the tool's way between them."""
    stated = Scenario()
    setup = Setup(
        geometry=Box(size=(X, Y, Z)),
        tool=Tool(radius=RADIUS),
        mass=stated.mass,
        material=Material(young_modulus=stated.young_modulus, poisson_ratio=stated.poisson_ratio),
    )
    for hidden in effects:
        setup = from_json({"effect": hidden.effect, "parameters": dict(hidden.parameters)}).apply(
            setup
        )
    times = (
        np.unique(np.round(np.concatenate([np.arange(1.0, looks[-1], 0.12), looks]), 6))
        if effects
        else np.array(looks)
    )
    frames = replay(setup, motion.centre(times), REPLAY_GRID, times=times)
    require_converged(frames)
    return [frames[int(np.argmin(np.abs(times - look)))] for look in looks]


def _size(field: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(field**2, axis=-1))))


@pytest.mark.parametrize("effect", [DELAYED, KEPT], ids=["viscoelasticity", "permanent_set"])
def test_bench_and_replay_agree_on_what_a_push_leaves(effect: HiddenEffect) -> None:
    motion, looks = _poke(), [2.5, 4.2, 5.4]
    solved = _made(motion, effect)
    frames = _replayed(motion, looks, effect)
    for look, frame in zip(looks, frames, strict=True):
        true = solved.displacement(look)
        assert _size(true - (frame.move(solved.rest) - solved.rest)) < 0.09 * _size(true)
    pushed = solved.tool_force(np.array([looks[0]]))[0]
    assert np.linalg.norm(pushed + frames[0].force) < 0.06 * np.linalg.norm(pushed)
    dent = np.abs(solved.displacement(looks[1])).max()
    assert dent > (0.15 if effect is KEPT else 0.2) * DEPTH
    last = np.abs(solved.displacement(looks[2])).max()
    # A standard linear solid recovers with its retardation time, tau / (1 - relaxed fraction) = 1.6
    # s; a set does not.
    assert last / dent == pytest.approx(1.0 if effect is KEPT else np.exp(-1.2 / 1.6), rel=0.03)


def test_bench_and_replay_agree_on_a_drag() -> None:
    motion, look = _drag(), [2.8]
    (rough,), (smooth,) = _replayed(motion, look, ROUGH), _replayed(motion, look)
    solved, plain = _made(motion, ROUGH), _made(motion)
    true, without = solved.displacement(look[0]), plain.displacement(look[0])
    found = rough.move(solved.rest) - solved.rest
    assert _size(true - found) < 0.09 * _size(true)
    dragged = np.argmax(np.linalg.norm(true - (smooth.move(solved.rest) - solved.rest), axis=1))
    assert (
        true[dragged, 0] > 0.5e-3 and abs(without).max() > 2e-3
    )  # along with the tool, which goes to +x
    force = solved.tool_force(np.array(look))[0]
    assert force[0] > 0.1 * -force[2] and np.linalg.norm(
        force + rough.force
    ) < 0.12 * np.linalg.norm(force)
    assert np.allclose(solved.displacement(END), 0.0, atol=1e-6)


def test_history_of_a_push_lasts_to_the_next() -> None:
    way = _poke().pushes[0]
    later = PlannedPush(way.waypoints, way.times + 3.5, way.arcs)
    motion = MotionPlan("poke-top-01", AWAY, (way, later), 8.5)
    first, second = solve_motion(Scenario(effects=(KEPT,)), motion, 3.6e-3).solved_pushes
    assert np.abs(second.settled).max() > 0.15 * DEPTH
    # The second push goes no further than the first, and leaves no more.
    assert np.allclose(second.displacement(8.4), first.displacement(4.4), atol=5e-5)
    pushes = [
        -one.tool_force(np.array([time]))[0, 2] for one, time in ((first, 1.5), (second, 5.0))
    ]
    assert 0 < pushes[1] < 0.8 * pushes[0]  # half way in, where the dent is there already


@pytest.fixture(scope="module")
def block():
    return mesh_block(
        (0.03, 0.02, 0.02), TetGrading(np.zeros((1, 3)), np.zeros(1), np.full(1, 12e-3), 12e-3)
    )


def _bent(block) -> Any:
    rng = np.random.default_rng(2)
    return block.nodes @ rng.uniform(-0.2, 0.2, (3, 3)) + 3e-4 * rng.normal(size=block.nodes.shape)


def test_forces_and_stiffness_of_a_metric_are_slopes_of_its_energy(block) -> None:
    rng = np.random.default_rng(5)
    metric = rng.normal(size=(*block.weights.shape, 3, 3)) * 0.2
    metric = np.eye(3) + metric + np.swapaxes(metric, 2, 3)
    grid, shear = (
        (block.elements, block.gradients, block.weights),
        np.full(block.weights.shape, 2e3),
    )
    u, step = _bent(block), 1e-7

    def answer(where: Any) -> Any:
        stiffness, force = np.zeros((len(block.elements), 10, 10, 3, 3)), np.zeros_like(where)
        assemble_metric(where, *grid, shear, metric, stiffness, force)
        lower = np.tril_indices(10, -1)
        stiffness[:, lower[0], lower[1]] = np.swapaxes(stiffness[:, lower[1], lower[0]], 2, 3)
        return stiffness, force

    stiffness, force = answer(u)
    way = rng.normal(size=u.shape)
    slope = (
        metric_energy(u + step * way, *grid, shear, metric)
        - metric_energy(u - step * way, *grid, shear, metric)
    ) / (2 * step)
    assert slope == pytest.approx(float(np.sum(force * way)), rel=1e-6)
    bent = (answer(u + step * way)[1] - answer(u - step * way)[1]) / (2 * step)
    product = np.zeros_like(u)
    np.add.at(product, block.elements, np.einsum("eabij,ebj->eai", stiffness, way[block.elements]))
    assert product == pytest.approx(bent, rel=1e-5, abs=1e-6 * float(np.abs(bent).max()))


def test_unrelaxed_chains_carry_the_share_that_the_law_lacks(block) -> None:
    """Without the second invariant, that of a motion faster than all that relaxes is the law
    without a memory.
    """
    modulus, grid = (
        np.full(block.weights.shape, 5e3),
        (block.elements, block.gradients, block.weights),
    )
    memory, u = InelasticHistory(Scenario(effects=(DELAYED,)), block), 0.05 * _bent(block)
    full, part = (constants(modulus, 0.45, share) for share in (0.0, 0.5))
    fast = solid_energy(u, *grid, part[0], part[1], part[2].mean(axis=1))
    fast += metric_energy(u, *grid, 2 * (full[0] + full[1]), memory.metric(0.0))
    assert fast == pytest.approx(
        solid_energy(u, *grid, full[0], full[1], full[2].mean(axis=1)), rel=0.02
    )
    slow = metric_energy(u, *grid, 2 * (full[0] + full[1]), memory.metric(None))
    assert slow == 0.0


def test_chains_follow_a_strain_that_is_held_with_their_time_constant(block) -> None:
    memory, u = InelasticHistory(Scenario(effects=(DELAYED,)), block), _bent(block)
    memory.inelastic_state = memory.after(u, 0.0)
    assert np.allclose(memory.inelastic_state.chains, np.eye(3))
    for time in (0.3, 0.8, 2.0):
        memory.inelastic_state = memory.after(u, time)
    still = np.linalg.inv(isochoric(u, block.elements, block.gradients))
    assert np.allclose(
        memory.inelastic_state.chains, still + (np.eye(3) - still) * np.exp(-2.0 / 0.8)
    )


def test_set_is_the_retained_share_of_the_largest_strain(block) -> None:
    memory, u = InelasticHistory(Scenario(effects=(KEPT,)), block), block.nodes * (0.2, -0.1, -0.1)
    for share in (0.5, 1.0, 0.4):
        memory.inelastic_state = memory.after(share * u, None)
    strain = np.log([1.2, 0.9, 0.9])
    strain -= strain.mean()
    assert np.allclose(memory.inelastic_state.peak_strain, np.diag(strain), atol=2e-3)
    assert np.allclose(
        memory.inelastic_state.natural, np.diag(np.exp(-2 * 0.2 * strain)), atol=2e-3
    )


def _held(memory: InelasticHistory, u: FloatArray, times: list[float]) -> None:
    for time in times:
        memory.inelastic_state = memory.after(u, time)


def test_second_law_relaxes_sooner_and_later_by_the_same_share(block) -> None:
    """Before the shorter time constant nothing has relaxed, long after the longer one all."""
    u = _bent(block)
    first, other = (
        InelasticHistory(Scenario(effects=(replace(DELAYED, second_law=law),)), block)
        for law in (False, True)
    )
    for memory in (first, other):
        memory.inelastic_state = memory.after(u, 0.0)
    assert np.allclose(first.metric(1e-9), other.metric(1e-9), atol=1e-6)
    assert np.abs(first.metric(0.8) - other.metric(0.8)).max() > 1e-3
    for memory in (first, other):
        _held(memory, u, [0.5, 2.0, 8.0, 60.0])
    assert np.allclose(first.metric(60.0), other.metric(60.0), atol=1e-6)
    assert other.time_constants == pytest.approx((0.8 / 3, 2.4))


def test_second_law_of_a_set_flows_above_a_strain_and_while_it_is_held(block) -> None:
    memory = InelasticHistory(Scenario(effects=(replace(KEPT, second_law=True),)), block)
    assert memory.relaxes
    large = block.nodes * (0.2, -0.1, -0.1)
    _held(memory, 0.05 * large, [0.0, 1.0, 2.0])
    assert not memory.inelastic_state.peak_strain.any()
    _held(memory, large, [2.1, 3.1])
    strain = np.log([1.2, 0.9, 0.9])
    strain -= strain.mean()
    kept = np.diag(strain) * (1 - np.exp(-1.1))
    assert np.allclose(memory.inelastic_state.peak_strain, kept, atol=2e-3)
    _held(memory, 0.9 * large, [8.0])
    assert np.allclose(memory.inelastic_state.peak_strain, kept, atol=2e-3)
