"""Gradients through whole replays of what remembers, by the adjoint, against central differences of whole replays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from deforming import DEFORMING

from core.adjoint import replay_loss_changes
from core.effects import Effect
from core.effects.load import Gravity
from core.effects.material import PoissonRatio, StiffInclusion
from core.effects.memory import PermanentSet, Viscoelasticity
from core.effects.support import BaseSlip
from core.effects.tool import ToolCompliance, ToolFriction, ToolOffset, ToolRadius
from core.errors import SetupError
from core.fem import drag
from core.fem.friction import Hold
from core.fem.newton import Outcome
from core.fem.points import MaterialPoints, material_points
from core.frames import FloatArray
from core.mesh import GridSpec
from core.replay import Equilibrium, Replay, replay, require_converged
from core.sensitivity import loss_changes
from core.setup import Box, Material, Relaxation, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
EVEN, GRADED = GridSpec(nodes=(7, 5, 5)), GridSpec(nodes=(7, 6, 5), spacing=3e-3)
TIGHT, STEP = 1e-9, 1e-3
RELAXES, KEEPS = Viscoelasticity(relaxed_fraction=0.5, time_constant=1.3), PermanentSet(retained_fraction=0.3)
RUBS = ToolFriction(friction_coefficient=0.3)
NOWHERE, COMPLIANCE = np.zeros(3), "compliance_times_stiffness"


def _way(*places: tuple[float, float]) -> FloatArray:
    """Centres (f, 3) [m] at these x and depths [m]."""
    return np.array([[x, -2e-3, SIZE[2] + 5e-3 - depth] for x, depth in places])


WAY = _way((4e-3, -6e-3), (4e-3, 2e-3), (4e-3, 3.5e-3), (6e-3, 3e-3), (6e-3, 1.5e-3), (6e-3, -6e-3), (6e-3, -6e-3))
"""Above the block, in, aside, part of the way out, and long enough away to see it come back."""
TIMES = np.array([0.0, 0.5, 1.4, 2.0, 2.2, 3.0, 5.0])


class _Loss:
    """Half the sum of squares of how far some material points are, in all frames, from where they were measured, as it were."""

    def __init__(self, frames: list[Equilibrium]) -> None:
        random = np.random.default_rng(0)
        self._points = random.uniform([-0.03, -0.015, 0.01], [0.03, 0.015, SIZE[2]], (8, 3))
        self._target = [0.8 * self._moved(frame) + 1e-4 * random.standard_normal((8, 3)) for frame in frames]

    def _moved(self, frame: Equilibrium) -> FloatArray:
        return frame.move(self._points) - self._points

    def of(self, frames: list[Equilibrium]) -> float:
        require_converged(frames)
        pairs = zip(frames, self._target, strict=True)
        return sum(0.5 * float(((self._moved(frame) - target) ** 2).sum()) for frame, target in pairs)

    def slopes(self, frames: list[Equilibrium]) -> list[FloatArray]:
        found = [np.zeros_like(frame.displacement) for frame in frames]
        for frame, target, slope in zip(frames, self._target, found, strict=True):
            nodes, weights = frame.mesh.locate(self._points)
            np.add.at(slope, nodes, weights[..., None] * (self._moved(frame) - target)[:, None])
        return found


def _gradients(
    base: Setup, effect: Effect, grid: GridSpec, way: FloatArray = WAY, step: float = STEP
) -> tuple[FloatArray, FloatArray]:
    """The adjoint's gradient by each of the effect's numbers, and that of whole replays, so many scales of it apart."""
    block, found, wanted = Replay(effect.apply(base), grid, TIGHT), [], []
    frames = replay(block.setup, way, grid, times=TIMES, tolerance=TIGHT)
    loss = _Loss(frames)
    for item, here in zip(effect.numbers(), effect.coordinates, strict=True):

        def changed(scales: float, item=item, here=here) -> Setup:
            return replace(effect, **{item.name: item.value(here + scales * item.scale)}).apply(base)

        near = [(changed(sign * 0.1 * step), NOWHERE) for sign in (1, -1)]
        rise, fall = replay_loss_changes(block, frames, loss.slopes(frames), near, TIMES) / 0.1
        above, below = (loss.of(replay(changed(sign * step), way, grid, times=TIMES, tolerance=TIGHT)) for sign in (1, -1))
        found.append(rise - fall)
        wanted.append(above - below)
    assert np.all(wanted)
    return np.array(found), np.array(wanted)


def _agree(gradients: tuple[FloatArray, FloatArray]) -> bool:
    found, wanted = gradients
    return found == pytest.approx(wanted, rel=1e-3, abs=0.0)


@pytest.mark.parametrize("name", DEFORMING)
def test_block_that_relaxes_has_the_gradient_of_whole_replays_by_every_effect(name):
    assert _agree(_gradients(RELAXES.apply(SETUP), DEFORMING[name], EVEN))


@pytest.mark.parametrize("grid", [EVEN, GRADED, GridSpec(nodes=(5, 5, 3), order=2)], ids=["even", "graded", "quadratic"])
def test_relaxation_itself_has_the_gradient_of_whole_replays(grid):
    assert _agree(_gradients(SETUP, RELAXES, grid))
    assert _agree(_gradients(RELAXES.apply(SETUP), Viscoelasticity(relaxed_fraction=0.2, time_constant=0.2), grid))


@pytest.mark.parametrize("name", DEFORMING)
def test_block_that_keeps_a_set_has_the_gradient_of_whole_replays_by_every_effect(name):
    """The tangent of a set that grows is not symmetric."""
    assert _agree(_gradients(KEEPS.apply(SETUP), DEFORMING[name], EVEN))


@pytest.mark.parametrize("grid", [EVEN, GRADED], ids=["even", "graded"])
def test_set_itself_has_the_gradient_of_whole_replays_also_in_a_block_that_relaxes(grid):
    assert _agree(_gradients(SETUP, KEEPS, grid))
    assert _agree(_gradients(RELAXES.apply(SETUP), KEEPS, grid))


def test_sag_under_a_giving_tool_of_a_block_that_relaxes_and_keeps_a_set():
    sagging = Gravity(specific_weight_over_stiffness=1.0).apply(KEEPS.apply(RELAXES.apply(SETUP)))
    deep = WAY - np.array([0.0, 0.0, 1e-3])
    assert _agree(_gradients(sagging, ToolCompliance(compliance_times_stiffness=20.0), EVEN, deep))
    assert _agree(
        _gradients(ToolCompliance(compliance_times_stiffness=20.0).apply(sagging), ToolOffset(dx=2e-4, dy=0.0, dz=1e-4), EVEN, deep)
    )


@pytest.mark.parametrize("grid", [EVEN, GRADED, GridSpec(nodes=(5, 5, 3), order=2)], ids=["even", "graded", "quadratic"])
def test_ways_back_from_a_material_s_points_are_the_transposes_of_the_ways_there(grid):
    mesh = grid.mesh(SETUP, WAY[3])
    points: MaterialPoints = material_points(SETUP, grid, mesh)
    random = np.random.default_rng(0)
    nodes: FloatArray = random.standard_normal(mesh.nodes.shape)
    there = points.tangents(mesh, nodes)
    rows = np.asarray(random.standard_normal(there.shape))
    assert np.vdot(rows, there) == pytest.approx(np.vdot(points.tangents_transposed(mesh, rows), nodes), rel=1e-10)
    field = np.asarray(random.standard_normal((len(there), 6)))
    read = points.read(mesh, field)
    back = np.asarray(random.standard_normal(read.shape))
    assert np.vdot(back, read) == pytest.approx(np.vdot(points.read_transposed(mesh, back), field), rel=1e-10)


@pytest.fixture
def agreed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pressure and friction agree to the last digits, so that differences of whole replays are worth something."""
    monkeypatch.setattr(drag, "_AGREED", TIGHT)
    monkeypatch.setattr(drag, "_MOST_TURNS", 300)


RUBBED = _way((4e-3, 1e-3), (4e-3, 2.5e-3), (4.33e-3, 3e-3), (5.13e-3, 3e-3), (5.13e-3, -6e-3), (6.07e-3, 2e-3), (7.11e-3, 2.2e-3))
"""In, aside in stick and in slip, out, and in again beside."""


@pytest.mark.usefixtures("agreed")
@pytest.mark.parametrize("name", [name for name in DEFORMING if name != "tool_compliance"])
def test_tool_that_drags_the_surface_has_the_gradient_of_whole_replays_by_every_effect(name):
    """Between changes of stick and slip: one within the step of a difference is no part of a gradient."""
    assert _agree(_gradients(RUBS.apply(SETUP), DEFORMING[name], EVEN, RUBBED, 1e-4))


@pytest.mark.usefixtures("agreed")
@pytest.mark.parametrize("grid", [EVEN, GRADED], ids=["even", "graded"])
def test_friction_itself_has_the_gradient_of_whole_replays_also_in_a_block_that_remembers(grid):
    assert _agree(_gradients(SETUP, RUBS, grid, RUBBED, 1e-4))
    assert _agree(_gradients(RELAXES.apply(SETUP), RUBS, grid, RUBBED, 1e-4))
    assert _agree(_gradients(RUBS.apply(SETUP), RELAXES, grid, RUBBED, 1e-4))


@pytest.mark.usefixtures("agreed")
def test_friction_on_a_block_that_relaxes_and_keeps_a_set():
    rubbed = RUBS.apply(RELAXES.apply(SETUP))
    assert _agree(_gradients(rubbed, KEEPS, EVEN, RUBBED, 1e-4))
    assert _agree(_gradients(KEEPS.apply(rubbed), ToolOffset(dx=2e-4, dy=0.0, dz=1e-4), EVEN, RUBBED, 1e-4))


def test_gradient_with_friction_at_the_tolerances_of_a_replay_is_nearly_that_of_exact_ones(monkeypatch):
    setup = RUBS.apply(SETUP)
    changes = [
        (ToolFriction(friction_coefficient=0.301).apply(SETUP), NOWHERE),
        (replace(setup, material=Material(poisson_ratio=0.451)), NOWHERE),
    ]

    def gradient(tolerance: float) -> FloatArray:
        frames = replay(setup, RUBBED, EVEN, tolerance=tolerance)
        slopes = [1e-4 * frame.displacement for frame in frames]
        return replay_loss_changes(Replay(setup, EVEN, tolerance), frames, slopes, changes)

    found = gradient(1e-6)
    monkeypatch.setattr(drag, "_AGREED", TIGHT)
    monkeypatch.setattr(drag, "_MOST_TURNS", 300)
    assert found == pytest.approx(gradient(TIGHT), rel=0.01)


def test_way_back_from_what_friction_holds_is_the_transpose_of_the_way_there():
    random = np.random.default_rng(0)
    touched = np.arange(50) % 3 > 0
    hold = Hold(
        random.uniform(size=(50, 3)), random.standard_normal((50, 3)) * touched[:, None], touched, np.where(touched, 1.0, 0.0)
    )
    places = random.uniform(size=(4, 7, 3))
    costate = np.asarray(random.standard_normal((4, 7, 3)))
    there = hold.at(places).ways
    assert there.any()
    assert np.vdot(costate, there) == pytest.approx(np.vdot(hold.at_transposed(places, costate), hold.ways), rel=1e-12)


ASIDE = np.array([[-SIZE[0] / 2 - 5e-3 + depth, 1.03e-3, 0.02007] for depth in (1e-3, 2e-3, 3e-3, 4e-3, 3.5e-3, 4.7e-3, 5.2e-3)])
"""Against a side, so that the base slides, back a little, and on."""


@pytest.mark.parametrize("grid", [EVEN, GRADED], ids=["even", "graded"])
@pytest.mark.parametrize("memory", [False, True], ids=["without memory", "with memory"])
def test_base_that_slid_has_the_gradient_of_whole_replays(grid, memory):
    setup = RELAXES.apply(SETUP) if memory else SETUP
    slides = BaseSlip(friction_coefficient=0.1)
    frames = replay(slides.apply(setup), ASIDE, grid, times=TIMES)
    assert frames[3].slip[0] > 3e-4 and frames[-1].slip[0] > frames[3].slip[0] + 3e-4
    lump = StiffInclusion(x=-0.024, y=1e-3, z=0.022, radius=8e-3, stiffness_ratio=2.0)
    assert _agree(_gradients(setup, slides, grid, ASIDE, 1e-5))
    for effect in (PoissonRatio(nu=0.43), lump, ToolRadius(radius=5.2e-3), ToolOffset(dx=2e-4, dy=-2.2e-4, dz=1e-5)):
        assert _agree(_gradients(slides.apply(setup), effect, grid, ASIDE, 1e-5))


def test_frame_without_equilibrium_counts_as_passed_over():
    setup, inside = RELAXES.apply(SETUP), np.array([0.0, 0.0, 2e-3])  # in the held base
    longer, when = np.insert(WAY, 3, inside, axis=0), np.insert(TIMES, 3, 1.7)
    frames = replay(setup, longer, EVEN, times=when, tolerance=TIGHT)
    assert frames[3].outcome is not Outcome.CONVERGED
    slopes = [1e-4 * np.ones_like(frame.displacement) for frame in frames]
    change, block = [(replace(setup, tool=Tool(radius=5.001e-3)), NOWHERE)], Replay(setup, EVEN, TIGHT)
    found = replay_loss_changes(block, frames, slopes, change, when)
    others = np.delete(np.arange(len(when)), 3)
    kept, seen = [frames[i] for i in others], [slopes[i] for i in others]
    assert found == pytest.approx(replay_loss_changes(block, kept, seen, change, TIMES), rel=1e-12)


def test_block_without_memory_has_the_sum_of_its_frames_gradients():
    frames = replay(SETUP, WAY, EVEN, tolerance=TIGHT)
    loss, block = _Loss(frames), Replay(SETUP, EVEN, TIGHT)
    softer = replace(SETUP, material=Material(poisson_ratio=0.4501))
    aside = 1e-6 * np.arange(len(WAY))[:, None] * np.array([1.0, 0.0, -1.0])
    found = replay_loss_changes(block, frames, loss.slopes(frames), [(softer, NOWHERE), (SETUP, aside)])
    pairs = list(zip(frames, loss.slopes(frames), aside, strict=True))
    wanted = sum(loss_changes(block, frame, slope, [(softer, NOWHERE), (SETUP, move)]) for frame, slope, move in pairs)
    assert found == pytest.approx(wanted, rel=1e-9)


def test_what_the_way_through_the_frames_does_not_tell_is_refused():
    frames = replay(SETUP, WAY[:2], EVEN)
    slopes = [np.zeros_like(frame.displacement) for frame in frames]
    slid = [replace(frame, slip=np.array([1e-4, 0.0])) for frame in frames]
    held = BaseSlip(friction_coefficient=0.4).apply(SETUP)
    for setup, changed, way, told in (
        (SETUP, RELAXES.apply(SETUP), frames, "relaxation"),
        (SETUP, KEEPS.apply(SETUP), frames, "retained_fraction"),
        (held, SETUP, slid, "friction_coefficient"),
        (RUBS.apply(held), RUBS.apply(held), slid, "friction_coefficient"),
        (SETUP, RUBS.apply(SETUP), frames, "friction_coefficient"),
        (RUBS.apply(SETUP), ToolCompliance(compliance_times_stiffness=1.0).apply(RUBS.apply(SETUP)), frames, COMPLIANCE),
    ):
        with pytest.raises(SetupError) as caught:
            replay_loss_changes(Replay(setup, EVEN), way, slopes, [(changed, NOWHERE)])
        assert caught.value.where["key"] == told


def test_term_of_nothing_has_the_gradient_from_none():
    """Where a search for relaxation begins, from a material that does not relax."""
    none = replace(SETUP, material=Material(relaxation=(Relaxation(fraction=0.0, time_constant=1.3),)))
    block = Replay(none, EVEN, TIGHT)
    frames = replay(none, WAY, EVEN, times=TIMES, tolerance=TIGHT)
    loss = _Loss(frames)
    some = Viscoelasticity(relaxed_fraction=1e-5, time_constant=1.3).apply(SETUP)
    (found,) = replay_loss_changes(block, frames, loss.slopes(frames), [(some, NOWHERE)], TIMES)
    wanted = loss.of(replay(some, WAY, EVEN, times=TIMES, tolerance=TIGHT)) - loss.of(frames)
    assert found == pytest.approx(wanted, rel=1e-3)
