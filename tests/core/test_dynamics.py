"""Replays with inertia, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from core.dynamics import Damping, MovingBlock, replay_in_time
from core.errors import SetupError
from core.mesh import GridSpec
from core.replay import replay, require_converged
from core.setup import Box, Load, Material, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
GRIDS = pytest.mark.parametrize(
    "grid", [GridSpec(nodes=(5, 4, 4)), GridSpec(nodes=(5, 5, 3), order=2)], ids=["trilinear", "quadratic"]
)
DAMPING = pytest.mark.parametrize("damping", [Damping(), Damping(mass=4.0, stiffness=0.01)], ids=["free", "damped"])
AWAY = np.array([0.0, 0.0, 1.0])
POKE = np.array([[5e-3, 2e-3, SIZE[2] + 5e-3 - depth] for depth in (-1e-3, 1e-3, 3e-3, 5e-3)])


def _of(modulus: float) -> Setup:
    return replace(SETUP, material=Material(young_modulus=modulus))


def _first_mode(block: MovingBlock) -> tuple[np.ndarray, float]:
    """Shape (u,) of the slowest mode about rest, and its angular frequency [1/s]; from dense matrices."""
    model = block.model
    inertia = block._inertia
    mass, stiffness = (inertia._whole(data).toarray() for data in (inertia._mass, model.assemble(model.mesh.nodes, None).data))
    squares, shapes = eigh(stiffness, mass, subset_by_index=[0, 0])
    return shapes[:, 0], float(np.sqrt(squares[0]))


@GRIDS
def test_mass_of_the_unknowns_and_of_the_held_base_is_that_of_the_block(grid):
    block = MovingBlock(replace(SETUP, support=Support(stiffness_over_E=100.0)), grid, Damping())
    along = np.zeros(block.model.mesh.nodes.shape)
    along[:, 0] = 1.0
    mass = block._inertia._whole(block._inertia._mass)
    whole = along.ravel() @ mass @ along.ravel()
    assert whole * SETUP.material.young_modulus == pytest.approx(SETUP.mass, rel=1e-12)


@GRIDS
@DAMPING
def test_mode_let_go_falls_in_each_step_as_implicit_euler_says(grid, damping):
    block, step = MovingBlock(SETUP, grid, damping, tolerance=1e-9), 4e-3
    shape, frequency = _first_mode(block)
    assert 20 < frequency < 200
    free = block.model.topology.free
    scale = 1e-6 / np.abs(shape).max()
    block.positions[free] += scale * shape
    drag = damping.mass + damping.stiffness * frequency**2
    place, speed = scale, 0.0
    for _ in range(20):
        last = place
        place = (last / step**2 + speed / step + drag * last / step) / (1 / step**2 + drag / step + frequency**2)
        speed = (place - last) / step
        assert block.advance(AWAY, step).converged
        found = (block.positions - block.model.mesh.nodes)[free]
        assert np.abs(found - place * shape).max() < 2e-3 * scale * np.abs(shape).max()


@GRIDS
def test_slow_motion_is_that_without_inertia(grid):
    setup = replace(SETUP, load=Load(specific_weight_over_stiffness=0.5))
    wanted = replay(setup, POKE, grid)
    found = replay_in_time(setup, POKE, [0.0, 1e3, 2e3, 3e3], grid, damping=Damping(mass=0.1, stiffness=0.1))
    require_converged(found)
    for frame, still in zip(found, wanted, strict=True):
        assert np.abs(frame.displacement - still.displacement).max() < 2e-6
        assert frame.force == pytest.approx(still.force, rel=1e-3, abs=1e-5)


def test_modulus_counts_only_where_waves_are_slow():
    """With Rayleigh damping alone the modulus cancels, too: forces of springs and dampers are both proportional to it."""
    times, grid, damping = np.arange(4) / 30, GridSpec(nodes=(9, 5, 5)), Damping(mass=0.1, stiffness=0.1)
    stiff, stiffer, soft = (
        replay_in_time(_of(modulus), POKE, times, grid, damping=damping, steps=4)[-1].displacement for modulus in (1e6, 1e5, 1e1)
    )
    assert np.abs(stiff - stiffer).max() < 2e-5
    assert np.abs(soft - stiff).max() > 5e-4


def test_damping_delays_the_recovery_of_a_dent():
    way = np.array([POKE[-1], *[POKE[0]] * 8])
    times, grid = np.array([0.0, *(1 / 30 + np.arange(8) / 30)]), GridSpec(nodes=(9, 5, 5))
    left = [
        np.abs(replay_in_time(SETUP, way, times, grid, damping=Damping(stiffness=late), steps=2)[-1].displacement).max()
        for late in (0.01, 0.1)
    ]
    assert left[1] > 10 * left[0]


def test_what_has_no_inertia_and_times_out_of_order_are_turned_down():
    with pytest.raises(SetupError, match="even"):
        MovingBlock(SETUP, GridSpec(nodes=(9, 7, 5), spacing=2e-3), Damping())
    with pytest.raises(SetupError, match="sliding"):
        MovingBlock(replace(SETUP, support=Support(friction_coefficient=0.2)), GridSpec(), Damping())
    with pytest.raises(SetupError, match="gives way"):
        MovingBlock(replace(SETUP, tool=Tool(radius=5e-3, compliance_times_stiffness=10.0)), GridSpec(), Damping())
    with pytest.raises(SetupError, match="at least one step"):
        replay_in_time(SETUP, POKE, [0.0, 0.1, 0.2, 0.3], GridSpec(), damping=Damping(), steps=0)
    with pytest.raises(SetupError, match="later"):
        replay_in_time(SETUP, POKE, [0.0, 0.1, 0.1, 0.2], GridSpec(), damping=Damping())
