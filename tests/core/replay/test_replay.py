from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.model import BlockModel
from palpate.fem.newton import Outcome
from palpate.foundation.errors import SolveError
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.equilibrium import predict_from_similar
from palpate.replay.replay import GRAVITY, Equilibrium, Replay, replay, require_converged, rest
from palpate.setup.setup import Box, Detachment, Load, Material, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
TOP = SIZE[2]
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
EVEN = GridSpec(nodes=(13, 5, 5))
GRADED = GridSpec(nodes=(11, 9, 7), spacing=1.5e-3)


def _way(*corners: tuple[float, float, float], frames: int) -> np.ndarray:
    """Tool centres (f, 3) [m] along straight lines between corners, at one speed."""
    points = np.array(corners)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.stack(
        [np.interp(np.linspace(0, along[-1], frames), along, points[:, axis]) for axis in range(3)],
        axis=1,
    )


def _poke(depth: float, frames: int, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    """Straight down from just above the top; depth [m]."""
    return _way((x, y, TOP + 5.0e-3), (x, y, TOP + 5e-3 - depth), frames=frames)


def _top(frame: Equilibrium) -> np.ndarray:
    """Displacement of a dense sampling of the top (m, 3) [m]."""
    x, y = np.meshgrid(np.linspace(-0.03, 0.03, 41), np.linspace(-0.018, 0.018, 25))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, TOP)], axis=1)
    return frame.move(points) - points


def _relative(found: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


def test_block_that_is_not_touched_stays_as_stated():
    frames = replay(SETUP, _way((-0.02, 0, TOP + 0.02), (0.02, 0, TOP + 6e-3), frames=5), EVEN)
    assert all(
        not frame.in_contact and not frame.displacement.any() and not frame.force.any()
        for frame in frames
    )


@pytest.mark.parametrize("grid", [EVEN, GridSpec(nodes=(25, 9, 9))], ids=["13x5x5", "25x9x9"])
@pytest.mark.parametrize("motion", ["top", "side", "drag"])
def test_every_frame_finds_its_equilibrium(grid, motion):
    ways = {
        "top": _way(
            (0.005, 0.003, TOP + 6e-3),
            (0.005, 0.003, TOP - 3e-3),
            (0.005, 0.003, TOP + 6e-3),
            frames=13,
        ),
        "side": _way(
            (SIZE[0] / 2 + 6e-3, 0, 0.02),
            (SIZE[0] / 2 - 3e-3, 0, 0.02),
            (SIZE[0] / 2 + 6e-3, 0, 0.02),
            frames=13,
        ),
        "drag": _way(
            (0.015, 5e-3, TOP + 6e-3),
            (0.015, 5e-3, TOP + 1e-3),
            (0.045, 5e-3, TOP + 1e-3),
            frames=21,
        ),
    }
    frames = replay(SETUP, ways[motion], grid)
    require_converged(frames)
    assert max(frame.penetration for frame in frames) < 4e-4
    assert any(frame.in_contact for frame in frames) and not frames[-1].in_contact
    assert not frames[-1].displacement.any()


def test_push_to_two_fifths_of_the_height_converges():
    frames = replay(SETUP, _poke(0.4 * TOP, 25), EVEN)
    require_converged(frames)
    pushes = [frame.force[2] for frame in frames]
    assert all(later > earlier for earlier, later in itertools.pairwise(pushes))


def test_jumping_tool_converges():
    centres = np.array(
        [
            (0, 0, TOP + 6e-3),
            (0, 0, TOP + 1e-3),
            (5e-3, 0, TOP + 1e-3),
            (5e-3, 5e-3, TOP - 3e-3),
            (0, 0, TOP - 3e-3),
            (-0.01, 0, TOP + 1e-3),
        ]
    )
    frames = replay(SETUP, centres, GRADED)
    require_converged(frames)
    alone = Replay(SETUP, GRADED).step(centres[-1])
    assert _relative(_top(frames[-1]), _top(alone)) < 1e-3


def test_jump_through_the_block_comes_in_from_outside():
    centres = np.array([(-0.01, 0, TOP + 1e-3), (SIZE[0] / 2 + 2e-3, 0, 0.02)])
    frames = replay(replace(SETUP, material=Material(poisson_ratio=0.49)), centres, EVEN)
    require_converged(frames)
    assert frames[1].force[0] > 3 * np.linalg.norm(
        frames[1].force[1:]
    )  # pressed out sideways, not held from within


def test_force_of_a_poke_is_that_of_a_much_finer_grid():
    frames = replay(SETUP, _poke(8e-3, 9), GridSpec(nodes=(17, 13, 10), spacing=1e-3))
    # 33x27x21 nodes, 0.45 mm at the contact
    assert frames[4].force[2] == pytest.approx(0.1425, rel=0.04)
    assert frames[8].force[2] == pytest.approx(0.351, rel=0.06)


@pytest.mark.slow
def test_top_moves_as_on_a_finer_grid():
    coarse = replay(SETUP, _poke(4e-3, 5), GridSpec(nodes=(17, 13, 10), spacing=1e-3))[-1]
    fine = replay(SETUP, _poke(4e-3, 5), GridSpec(nodes=(27, 21, 16), spacing=6e-4))[-1]
    assert _relative(_top(coarse), _top(fine)) < 0.10
    assert coarse.force[2] == pytest.approx(fine.force[2], rel=0.03)


def test_grid_error_falls_as_the_grid_is_refined():
    grids = [
        GridSpec(nodes=(7, 5, 4), spacing=3e-3),
        GridSpec(nodes=(11, 9, 7), spacing=1.5e-3),
        GridSpec(nodes=(17, 15, 11), spacing=8e-4),
    ]
    tops = [_top(replay(SETUP, _poke(4e-3, 3), grid)[-1]) for grid in grids]
    assert _relative(tops[0], tops[2]) > 2 * _relative(tops[1], tops[2])


def test_nearly_incompressible_block_does_not_lock():
    def ratio(grid: GridSpec) -> float:
        stiff, soft = (
            replay(replace(SETUP, material=Material(poisson_ratio=nu)), _poke(3e-3, 2), grid)[
                -1
            ].force[2]
            for nu in (0.49, 0.45)
        )
        return stiff / soft

    coarse, fine = ratio(GRADED), ratio(GridSpec(nodes=(17, 13, 10), spacing=1e-3))
    assert coarse == pytest.approx(fine, rel=0.03)
    assert 1.0 < fine < 1.25


def test_shape_does_not_depend_on_the_modulus_and_force_is_proportional_to_it():
    soft, stiff = (
        replay(replace(SETUP, material=Material(young_modulus=e)), _poke(6e-3, 4), GRADED)[-1]
        for e in (1e1, 1e6)
    )
    assert np.array_equal(soft.displacement, stiff.displacement)
    assert np.allclose(stiff.force, 1e5 * soft.force, rtol=1e-12)


def test_mirrored_poke_gives_the_mirrored_shape():
    left, right = (replay(SETUP, _poke(5e-3, 4, x=x, y=4e-3), GRADED)[-1] for x in (-8e-3, 8e-3))
    x, y = np.meshgrid(np.linspace(-0.03, 0.03, 31), np.linspace(-0.018, 0.018, 19))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, TOP)], axis=1)
    mirror = np.array([-1, 1, 1])
    assert np.allclose(left.move(points * mirror) * mirror, right.move(points), atol=1e-7)
    assert np.allclose(left.force * mirror, right.force, atol=1e-6 * np.abs(right.force).max())


def test_energy_stored_is_the_work_of_the_tool():
    block, frames = Replay(SETUP, GRADED), replay(SETUP, _poke(5e-3, 21), GRADED)
    heights = np.array([frame.tool.centre[2] for frame in frames])
    work = -np.trapezoid([frame.force[2] for frame in frames], heights)
    last = frames[-1]
    stored = (
        block.model(last.mesh).energy(last.mesh.nodes + last.displacement, last.tool)
        * SETUP.material.young_modulus
    )
    assert stored == pytest.approx(work, rel=0.01)


def test_equilibrium_does_not_depend_on_the_path():
    straight = replay(SETUP, _poke(4e-3, 4), GRADED)[-1]
    aside = replay(
        SETUP,
        _way((-6e-3, 0, TOP + 5e-3), (-6e-3, 0, TOP + 1e-3), (0, 0, TOP + 1e-3), frames=12),
        GRADED,
    )[-1]
    assert np.allclose(straight.tool.centre, aside.tool.centre)
    assert _relative(aside.displacement, straight.displacement) < 1e-4


def test_frames_start_as_well_from_those_of_a_similar_setup():
    centres = _poke(4e-3, 5)
    starts = replay(replace(SETUP, material=Material(poisson_ratio=0.4)), centres, GRADED)
    alone, led = replay(SETUP, centres, GRADED), replay(SETUP, centres, GRADED, starts=starts)
    assert _relative(led[-1].displacement, alone[-1].displacement) < 1e-4


def test_prediction_from_a_similar_setup_helps_as_the_base_comes_loose(monkeypatch):
    loose = replace(SETUP, support=Support(detached=(Detachment(edge="-x", extent=0.02),)))
    centres = _way((-0.022, 0, TOP + 4e-3), (-0.016, 0, TOP + 2e-3), frames=7)
    factors, factorise = [0], BlockModel.factorise

    def counted(self, data):
        factors[-1] += 1
        factorise(self, data)

    monkeypatch.setattr(BlockModel, "factorise", counted)
    starts = replay(SETUP, centres, GRADED)
    factors.append(0)
    led = replay(loose, centres, GRADED, starts=starts)
    factors.append(0)
    monkeypatch.setattr(
        "palpate.replay.fixed_base.predict_from_similar",
        lambda model, lesson, start, positions, tool: positions,
    )
    alone = replay(loose, centres, GRADED, starts=starts)
    require_converged([*led, *alone])
    assert (
        max(
            _relative(one.displacement, other.displacement)
            for one, other in zip(led, alone, strict=True)
        )
        < 1e-4
    )
    assert factors[1] < 0.8 * factors[2]


def test_prediction_is_skipped_for_a_frame_far_from_its_start():
    way = _poke(4e-3, 5)
    first, near = replay(SETUP, way, GRADED)[-2:]
    model, positions = Replay(SETUP, GRADED).model(near.mesh), near.mesh.nodes + near.displacement
    far = replace(near.tool, centre=near.tool.centre + np.array([2e-3, 0.0, 0.0]))
    assert predict_from_similar(model, (first, near), near, positions, far) is positions
    failed = replace(near, outcome=Outcome.ITERATIONS)
    assert predict_from_similar(model, (first, failed), near, positions, near.tool) is positions


@pytest.mark.parametrize("poisson_ratio", [0.44, 0.45])
def test_sag_under_own_weight_lies_between_confined_and_free_bar(poisson_ratio):
    weight = 1000 * GRAVITY / 5000
    material = Material(poisson_ratio=poisson_ratio)
    frame = rest(
        replace(SETUP, material=material, load=Load(specific_weight_over_stiffness=weight)),
        GridSpec(nodes=(13, 9, 9)),
    )
    sag = TOP - frame.move(np.array([[0.0, 0.0, TOP]]))[0, 2]
    free_bar = weight * TOP**2 / 2
    confined = free_bar * (1 + poisson_ratio) * (1 - 2 * poisson_ratio) / (1 - poisson_ratio)
    assert frame.outcome is Outcome.CONVERGED
    assert confined < sag < free_bar
    assert sag == pytest.approx(1.05e-3, rel=0.06)


def test_gravity_at_zero_weight_leaves_the_block_unchanged():
    assert not rest(SETUP, EVEN).displacement.any()


SIDE = _way(
    (SIZE[0] / 2 + 5e-3, 0, 0.02),
    (SIZE[0] / 2 - 3e-3, 0, 0.02),
    (SIZE[0] / 2 + 5e-3, 0, 0.02),
    frames=17,
)


def test_sliding_base_obeys_coulomb_and_stays_where_it_slid():
    friction = 0.14
    frames = replay(replace(SETUP, support=Support(friction_coefficient=friction)), SIDE, EVEN)
    require_converged(frames)
    slid = np.array([frame.slip[0] for frame in frames])
    for frame, before, after in zip(frames[1:], slid, slid[1:], strict=False):
        pull, load = np.linalg.norm(frame.force[:2]), SETUP.mass * GRAVITY + frame.force[2]
        assert pull <= friction * load + 2e-3 * friction * SETUP.mass * GRAVITY
        if after != before:
            assert pull > 0.95 * friction * load
    assert (np.diff(slid) <= 0).all() and slid[8] < -5e-4
    assert slid[2] == 0 and slid[-1] == slid[9] == slid[8]
    assert not frames[-1].displacement.any()


def test_rough_base_does_not_slide():
    rough, held = (
        replay(replace(SETUP, support=support), SIDE, EVEN)
        for support in (Support(friction_coefficient=3.0), Support())
    )
    for first, second in zip(rough, held, strict=True):
        assert not first.slip.any()
        assert np.array_equal(first.displacement, second.displacement)


def test_slipped_block_is_touched_at_its_new_position():
    block = Replay(replace(SETUP, support=Support(friction_coefficient=3.0)), EVEN)
    block.slip = np.array([3e-3, -1e-3])
    moved = block.step(np.array([3e-3, -1e-3, TOP + 2e-3]))
    still = Replay(SETUP, EVEN).step(np.array([0.0, 0.0, TOP + 2e-3]))
    assert np.allclose(moved.displacement, still.displacement, atol=1e-10)
    point = np.array([[0.0, 0.0, TOP]])
    assert np.allclose(moved.move(point) - still.move(point), [[3e-3, -1e-3, 0]], atol=1e-10)


def _detached(extent: float, centres: np.ndarray) -> Equilibrium:
    strips = (Detachment(edge="+x", extent=extent),) if extent else ()
    frames = replay(replace(SETUP, support=Support(detached=strips)), centres, GRADED)
    require_converged(frames)
    return frames[-1]


def test_lifted_base_never_goes_below_the_table_and_lifts_more_the_wider_the_strip():
    centres = _way((SIZE[0] / 2 + 5e-3, 0, 0.025), (SIZE[0] / 2, 0, 0.025), frames=5)
    lifts, shapes = [], []
    for extent in (0.0, 0.01, 0.02, 0.03):
        frame = _detached(extent, centres)
        base = frame.displacement[frame.mesh.connectivity.base_nodes]
        assert base[:, 2].min() > -2e-5
        lifts.append(base[:, 2].max())
        shapes.append(_top(frame))
    assert lifts[0] == 0 and all(
        later > earlier + 2e-4 for earlier, later in itertools.pairwise(lifts)
    )
    changes = [np.linalg.norm(shape - shapes[0]) for shape in shapes]
    assert all(later > earlier for earlier, later in itertools.pairwise(changes))


def test_strip_of_no_width_is_nearly_a_held_base():
    centres = _poke(4e-3, 3, x=-0.02)
    whole, narrow = _detached(0.0, centres), _detached(1e-4, centres)
    assert _relative(_top(narrow), _top(whole)) < 0.01


def test_tool_pushed_through_the_block_is_reported_and_nothing_else_breaks():
    frames = replay(SETUP, _poke(0.9 * TOP, 25), EVEN)
    outcomes = [frame.outcome for frame in frames]
    assert all(outcome is Outcome.CONVERGED for outcome in outcomes[:10])
    assert outcomes[-1] is not Outcome.CONVERGED
    assert all(
        np.isfinite(frame.displacement).all() and np.isfinite(frame.force).all() for frame in frames
    )
    first = next(
        number for number, outcome in enumerate(outcomes) if outcome is not Outcome.CONVERGED
    )
    with pytest.raises(
        SolveError, match=f"^frame {first}: .*residual .* after [0-9]+ iterations"
    ) as caught:
        require_converged(frames)
    assert (
        caught.value.where["frame"] == first
        and caught.value.where["outcome"] == outcomes[first].name
    )


def test_tool_swallowed_by_the_block_never_counts_as_equilibrium():
    frame = Replay(SETUP, EVEN).step(np.array([0.0, 0.0, 0.4 * TOP]))
    assert frame.outcome is not Outcome.CONVERGED


def test_replay_goes_on_after_a_frame_without_equilibrium():
    centres = np.concatenate([_poke(4e-3, 3), [[0.0, 0.0, 8e-3]], _poke(4e-3, 3)])
    frames = replay(SETUP, centres, EVEN)
    assert [frame.outcome is Outcome.CONVERGED for frame in frames] == [True] * 3 + [False] + [
        True
    ] * 3
    assert np.allclose(frames[2].displacement, frames[-1].displacement, atol=1e-7)


def test_progress_is_reported_frame_by_frame():
    seen: list[float] = []
    replay(SETUP, _poke(1e-3, 4), EVEN, report=lambda fraction, text: seen.append(fraction))
    assert seen == [0, 0.25, 0.5, 0.75]
