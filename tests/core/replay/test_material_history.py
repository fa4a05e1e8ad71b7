"""Replays of a material with history, against known properties."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from palpate.fem import contact_patch, model
from palpate.fem.constitutive.elastic import Law, lame
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.stiffness_derivatives import stiffness_changes
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.mesh_convergence import mesh_errors
from palpate.replay.replay import Equilibrium, Replay, replay, require_converged, rest
from palpate.setup.setup import Box, Load, Material, Relaxation, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
TOP = SIZE[2]
EVEN, GRADED = GridSpec(nodes=(13, 5, 5)), GridSpec(nodes=(9, 7, 6), spacing=2e-3)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
SHARE, LATE = 0.6, 2.0
DEPTHS = (1e-3, 2e-3, 3e-3, 4e-3)
GRIDS = pytest.mark.parametrize(
    "grid", [EVEN, GRADED, replace(EVEN, order=2)], ids=["even", "graded", "quadratic"]
)


def _relaxing(share: float = SHARE, late: float = LATE, **other: float) -> Setup:
    material = Material(relaxation=(Relaxation(fraction=share, time_constant=late),), **other)  # type: ignore[arg-type]
    return replace(SETUP, material=material)


def _poke(depth: float, x: float = 4e-3, y: float = -2e-3) -> FloatArray:
    return np.array([x, y, TOP + 5e-3 - depth])


def _way(*depths: float) -> FloatArray:
    return np.array([_poke(depth) for depth in depths])


def _relaxed(share: float = SHARE) -> Setup:
    """The elastic material with this share of the shear modulus removed and its bulk
    modulus kept.
    """
    mu, bulk = lame(Law(), SETUP.material.poisson_ratio)
    mu *= 1 - share
    young, nu = 9 * bulk * mu / (3 * bulk + mu), (3 * bulk - 2 * mu) / (2 * (3 * bulk + mu))
    material = Material(young_modulus=young * SETUP.material.young_modulus, poisson_ratio=nu)
    return replace(SETUP, material=material)


def _same(found: Equilibrium, wanted: Equilibrium, place: float, force: float) -> None:
    assert found.outcome is Outcome.CONVERGED
    assert np.abs(found.displacement - wanted.displacement).max() < place
    assert float(np.linalg.norm(found.force - wanted.force)) < force * max(
        float(np.linalg.norm(wanted.force)), 1e-3
    )


@GRIDS
def test_zero_share_equals_the_plain_replay(grid):
    """All parts of the history code run; a share of zero alone does not switch them off."""
    way = _way(*DEPTHS, 2e-3, -6e-3)
    plain = replay(SETUP, way, grid, tolerance=1e-9)
    assert _relaxing(0.0).has_history
    found = replay(_relaxing(0.0), way, grid, times=np.arange(len(way)), tolerance=1e-9)
    for frame, wanted in zip(found, plain, strict=True):
        _same(frame, wanted, 1e-9, 1e-6)


@GRIDS
def test_fast_push_has_the_instantaneous_modulus_and_slow_push_the_relaxed_one(grid, monkeypatch):
    way, relaxed = _way(*DEPTHS), _relaxed()
    fast = replay(_relaxing(), way, grid, times=1e-4 * np.arange(len(way)))
    _same(fast[-1], replay(SETUP, way, grid)[-1], 1e-6, 1e-3)
    slow = replay(
        _relaxing(), np.concatenate([_way(-6e-3), way]), grid, times=1e6 * np.arange(len(way) + 1)
    )
    for module in (model, contact_patch):  # the penalty of the contact does not relax
        stiffness = (
            module.CONTACT_STIFFNESS * SETUP.material.young_modulus / relaxed.material.young_modulus
        )
        monkeypatch.setattr(module, "CONTACT_STIFFNESS", stiffness)
    _same(slow[-1], replay(relaxed, way, grid)[-1], 2e-6, 1e-3)
    assert slow[-1].force[2] < 0.5 * fast[-1].force[2]


def test_force_on_a_tool_that_stays_relaxes_with_the_time_constant():
    """For a nearly incompressible block; the pressure's share does not relax, and changes the value
    slightly.
    """
    times = np.array([0.0, 1e-6, 2e-6, 3e-6, 0.5, 1.0, 2.0, 4.0, 40.0])
    frames = replay(_relaxing(poisson_ratio=0.49), _way(*DEPTHS, *[4e-3] * 5), EVEN, times=times)
    require_converged(frames)
    forces = np.array([frame.force[2] for frame in frames[3:]])
    assert forces / forces[0] == pytest.approx(
        1 - SHARE + SHARE * np.exp(-(times[3:] - times[3]) / LATE), abs=0.02
    )


@pytest.mark.parametrize("grid", [EVEN, GRADED], ids=["even", "graded"])
def test_dent_recovers_with_the_retardation_time(grid):
    """After a long push the dent is about the share of the whole that relaxed, and falls with tau /
    (1 - g).
    """
    way = _way(*DEPTHS, 4e-3, -6e-3, *[-6e-3] * 12)
    times = np.array([0, 1, 2, 3, 60, 60.001, *(60.001 + 0.4 * np.arange(1, 13))])
    frames = replay(_relaxing(poisson_ratio=0.49), way, grid, times=times)
    require_converged(frames)
    pressed, left = (float(np.linalg.norm(frame.displacement)) for frame in frames[4:6])
    assert not frames[5].in_contact and left == pytest.approx(SHARE * pressed, rel=0.1)
    sizes = [float(np.linalg.norm(frame.displacement)) for frame in frames[5:]]
    for earlier, later in pairwise(sizes):
        assert later / earlier == pytest.approx(np.exp(-0.4 * (1 - SHARE) / LATE), abs=0.01)


@pytest.mark.parametrize("period", [0.2, 4.0, 80.0])
def test_cycle_never_yields_work(period):
    down = np.linspace(0.0, 4e-3, 13)
    depths = np.concatenate([down, down[-2::-1], down[1:], down[-2::-1]])
    frames = replay(_relaxing(), _way(*depths), EVEN, times=period * np.arange(len(depths)) / 24)
    forces = np.array([frame.force[2] for frame in frames])
    work = np.concatenate([[0.0], np.cumsum((forces[1:] + forces[:-1]) / 2 * np.diff(depths))])
    assert work[24] > 0.01 * work.max() and work[48] > work[24] and work.min() > -1e-9


def test_moving_graded_grid_agrees_with_a_fine_even_one():
    """A drag and a release: the difference is at most that of the elastic replays of the same drag,
    and half of the dent's size.
    """
    places = [
        (-4e-3, 1.5e-3),
        (-4e-3, 3e-3),
        (-2.5e-3, 3e-3),
        (-1e-3, 3e-3),
        (0.5e-3, 3e-3),
        (2e-3, 3e-3),
    ]
    way = np.array([_poke(depth, x=x) for x, depth in [*places, (2e-3, -6e-3)]])
    fine, grid = GridSpec(nodes=(25, 15, 11)), GridSpec(nodes=(11, 9, 7), spacing=1.5e-3)
    across = np.meshgrid(np.linspace(-0.03, 0.03, 31), np.linspace(-0.018, 0.018, 19))
    points = np.stack([across[0].ravel(), across[1].ravel(), np.full(across[0].size, TOP)], axis=1)

    def apart(setup: Setup) -> tuple[FloatArray, FloatArray]:
        pair = [replay(setup, way, one, times=0.2 * np.arange(len(way))) for one in (fine, grid)]
        tops = np.array([[frame.move(points) - points for frame in frames] for frames in pair])
        rms = np.sqrt((np.array([tops[0], tops[1] - tops[0]]) ** 2).sum(axis=3).mean(axis=2))
        return rms[0], rms[1]

    size, off = apart(_relaxing())
    _, plain = apart(SETUP)
    assert off[:-1].max() < 1.3 * plain[:-1].max()
    assert size[-1] > 1e-4 and off[-1] < 0.25 * size[-1]


@GRIDS
def test_replay_continues_from_a_saved_state_without_a_break(grid):
    way, times = _way(*DEPTHS, 4e-3, 2e-3, -6e-3, -6e-3), 0.5 * np.arange(8)
    setup = replace(_relaxing(), support=Support(friction_coefficient=0.4))
    whole = replay(setup, way, grid, times=times, tolerance=1e-9)
    for cut in (3, 5, 7):
        block, frame = Replay(setup, grid, tolerance=1e-9), None
        for centre, time in zip(way[:cut], times, strict=False):
            frame = block.step(centre, frame, float(time))
        assert frame is not None
        saved = pickle.loads(pickle.dumps(block.state(frame)))
        rest_of_it = replay(setup, way[cut:], grid, times=times[cut:], since=saved, tolerance=1e-9)
        for found, wanted in zip(rest_of_it, whole[cut:], strict=True):
            _same(found, wanted, 1e-8, 1e-6)
        assert found.slip == pytest.approx(whole[-1].slip, abs=1e-9)


def test_frame_without_equilibrium_is_skipped():
    """The tool is put where no equilibrium exists; later frames are as if that frame did
    not exist.
    """
    setup, inside = _relaxing(), np.array([0.0, 0.0, 0.4 * TOP])
    way, times = (
        np.array([_poke(2e-3), _poke(4e-3), inside, _poke(3e-3)]),
        np.array([0.0, 0.5, 1.0, 1.5]),
    )
    frames = replay(setup, way, EVEN, times=times, tolerance=1e-9)
    assert [frame.outcome is Outcome.CONVERGED for frame in frames] == [True, True, False, True]
    kept = [0, 1, 3]
    wanted = replay(setup, way[kept], EVEN, times=times[kept], tolerance=1e-9)
    _same(frames[3], wanted[2], 1e-8, 1e-6)


def test_block_under_its_own_weight_is_relaxed_before_the_first_frame():
    heavy = Load(specific_weight_over_stiffness=1.0)
    setup, relaxed = replace(_relaxing(), load=heavy), _relaxed()
    over = relaxed.material.young_modulus / SETUP.material.young_modulus
    still = rest(replace(relaxed, load=Load(specific_weight_over_stiffness=1.0 / over)), EVEN)
    _same(rest(setup, EVEN), still, 1e-7, 1.0)
    frames = replay(
        setup,
        _way(-6e-3, 3e-3, 3e-3, -6e-3, -6e-3, -6e-3),
        EVEN,
        times=[0.0, 1.0, 30.0, 31.0, 300.0, 600.0],
    )
    require_converged(frames)
    _same(frames[0], still, 1e-7, 1.0)
    assert np.abs(frames[3].displacement - still.displacement).max() > 2e-4
    _same(frames[5], still, 1e-6, 1.0)


def test_stiffness_cancels_and_sides_mirror_each_other():
    way, times = np.array([_poke(depth, x=6e-3) for depth in (*DEPTHS, -6e-3)]), 0.3 * np.arange(5)
    soft, stiff = (
        replay(_relaxing(young_modulus=young), way, GRADED, times=times, tolerance=1e-8)[
            -1
        ].displacement
        for young in (1e1, 1e6)
    )
    assert np.abs(soft - stiff).max() < 1e-8
    other = replay(_relaxing(), way * [-1, 1, 1], GRADED, times=times)[-1]
    points = np.array([[6e-3, -2e-3, TOP], [1e-3, 3e-3, TOP]])
    here = replay(_relaxing(), way, GRADED, times=times)[-1].move(points)
    assert other.move(points * [-1, 1, 1]) * [-1, 1, 1] == pytest.approx(here, abs=2e-6)


def test_times_are_required_and_must_increase():
    setup, way = _relaxing(), _way(1e-3, 2e-3)
    with pytest.raises(SetupError, match="time") as caught:
        replay(setup, way, EVEN)
    assert caught.value.where["key"] == "times"
    for times in ([0.0, 0.0], [1.0, 0.5], [0.0, float("nan")]):
        with pytest.raises(SetupError, match="time") as caught:
            replay(setup, way, EVEN, times=times)
        assert caught.value.where["key"] == "times"
    with pytest.raises(SetupError, match="3 times for 2 frames"):
        replay(SETUP, way, EVEN, times=[0.0, 1.0, 2.0])


def test_functions_without_history_refuse_such_materials():
    setup = _relaxing()
    block = Replay(setup, EVEN)
    frame = block.step(_poke(2e-3), None, 0.0)
    nowhere, plain = np.zeros(3), Replay(SETUP, EVEN)
    asked = [
        lambda: displacement_changes(block, frame, [(setup, nowhere)]),
        lambda: displacement_changes(plain, frame, [(setup, nowhere)]),
        lambda: stiffness_changes(block, frame, np.ones((1, *block.model(frame.mesh).mu.shape))),
        lambda: mesh_errors(setup, [frame], EVEN),
    ]
    for question in asked:
        with pytest.raises(SetupError, match="relaxation") as caught:
            question()
        assert caught.value.where["key"] == "relaxation"


def test_impossible_histories_are_refused():
    with pytest.raises(SetupError, match="relaxed fractions"):
        Material(
            relaxation=(
                Relaxation(fraction=0.6, time_constant=1.0),
                Relaxation(fraction=0.6, time_constant=2.0),
            )
        )
    with pytest.raises(SetupError, match="corotational"):
        replace(_relaxing().material, law="corotational")
    with pytest.raises(SetupError, match="corotational"):
        Material(retained_fraction=0.2, law="corotational")
    with pytest.raises(SetupError, match="time_constant"):
        Relaxation(fraction=0.5, time_constant=0.0)


KEEPS = replace(SETUP, material=Material(retained_fraction=0.3))


@pytest.mark.parametrize("grid", [EVEN, GRADED], ids=["even", "graded"])
def test_push_leaves_a_dent_and_a_second_one_just_like_it_changes_nothing(grid):
    push = _way(2e-3, 4e-3, 2e-3, -6e-3)
    frames = replay(
        KEEPS, np.concatenate([push, push, _way(-6e-3)]), grid, times=np.arange(9), tolerance=1e-8
    )
    require_converged(frames)
    dent = frames[3].displacement
    assert (
        not frames[3].in_contact
        and 0.1 < np.linalg.norm(dent) / np.linalg.norm(frames[1].displacement) < 0.5
    )
    points = np.array(
        [[x, y, TOP] for x in (-5e-3, 2e-3, 4e-3, 8e-3) for y in (-6e-3, -2e-3, 5e-3)]
    )
    for found, wanted in ((5, 1), (6, 2), (7, 3), (8, 3)):
        assert frames[found].move(points) == pytest.approx(frames[wanted].move(points), abs=2e-7)
        assert frames[found].force == pytest.approx(frames[wanted].force, rel=1e-4, abs=1e-6)
    assert frames[4].force[2] < frames[0].force[2]


def test_permanent_set_depends_little_on_the_number_of_frames():
    few, many = (
        replay(KEEPS, _way(*np.linspace(0, 4e-3, count), -6e-3), EVEN, times=np.arange(count + 1))
        for count in (5, 17)
    )
    size = np.abs(many[-1].displacement).max()
    assert size > 5e-4 and np.abs(few[-1].displacement - many[-1].displacement).max() < 0.05 * size


def test_deeper_push_leaves_more_and_a_weaker_one_nothing_more():
    depths = (3e-3, -6e-3, 1.5e-3, -6e-3, 4.5e-3, -6e-3)
    frames = replay(KEEPS, _way(*depths), EVEN, times=np.arange(6), tolerance=1e-8)
    require_converged(frames)
    first, weaker, deeper = (frames[number].displacement for number in (1, 3, 5))
    assert np.abs(weaker - first).max() < 1e-4 * np.abs(first).max()
    assert np.linalg.norm(deeper) > 1.3 * np.linalg.norm(first)


def test_set_and_relaxation_continue_from_a_saved_state():
    setup = replace(KEEPS, material=replace(_relaxing().material, retained_fraction=0.3))
    way, times = _way(2e-3, 4e-3, 4e-3, 1e-3, -6e-3, -6e-3), 0.5 * np.arange(6)
    whole = replay(setup, way, GRADED, times=times, tolerance=1e-9)
    block, frame = Replay(setup, GRADED, tolerance=1e-9), None
    for centre, time in zip(way[:3], times, strict=False):
        frame = block.step(centre, frame, float(time))
    assert frame is not None
    saved = pickle.loads(pickle.dumps(block.state(frame)))
    for found, wanted in zip(
        replay(setup, way[3:], GRADED, times=times[3:], since=saved, tolerance=1e-9),
        whole[3:],
        strict=True,
    ):
        _same(found, wanted, 1e-8, 1e-6)


def test_tool_friction_and_material_history_work_together():
    """Sideways over the top: the drag turns the force, the set leaves a dent, and the relaxed share
    fades.
    """
    material = replace(_relaxing().material, retained_fraction=0.2)
    way = np.concatenate(
        [
            _way(1.5e-3, 3e-3),
            [_poke(3e-3, x=4e-3 + 1e-3 * step) for step in (1, 2)],
            _way(-6e-3, -6e-3),
        ]
    )
    ends = []
    for friction in (0.0, 0.4):
        setup = replace(
            SETUP, material=material, tool=replace(SETUP.tool, friction_coefficient=friction)
        )
        frames = replay(setup, way, EVEN, times=[0.0, 1.0, 2.0, 3.0, 4.0, 60.0])
        require_converged(frames)
        ends.append(frames)
        assert np.abs(frames[5].displacement).max() < np.abs(frames[4].displacement).max()
        assert np.abs(frames[5].displacement).max() > 1e-4
    smooth, rough = (frames[3].force for frames in ends)
    assert rough[0] < smooth[0] - 0.1 * rough[2]
