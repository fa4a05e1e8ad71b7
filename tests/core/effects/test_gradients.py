"""First-order changes of a replay by every effect, against solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from deforming import DEFORMING

from core.adjoint import replay_loss_changes
from core.effects import CATALOGUE, Slot, from_json
from core.effects.memory import PermanentSet, Viscoelasticity
from core.effects.tool import ToolFriction
from core.errors import SetupError
from core.mesh import GridSpec
from core.replay import Equilibrium, Replay
from core.sensitivity import displacement_changes, force_changes, loss_changes
from core.setup import Box, Load, Material, Setup, Support, Tool

SETUP = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=5e-3), mass=0.104)
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)
EVEN = GridSpec(nodes=(13, 9, 7))
"""Whose elements grow with the block."""
POKE = np.array([[5e-3, 2e-3, 0.0358 + 5e-3 - depth] for depth in (1e-3, 3e-3, 5e-3)])


def _with(effect: str, **parameters: float | str) -> Setup:
    return from_json({"effect": effect, "parameters": parameters}).apply(SETUP)


def _with_detachment(extent: float) -> Setup:
    return _with("base_detachment", edge="+x", extent=extent)


def _with_lump(ratio: float = 4.0, x: float = 6e-3, radius: float = 6e-3) -> Setup:
    return _with("stiff_inclusion", x=x, y=1e-3, z=0.024, radius=radius, stiffness_ratio=ratio)


LARGER = 1.0 + 1e-5


def _scaled(factors: dict[str, float]) -> Setup:
    return _with("geometry_scale", **{"scale_x": 1.0, "scale_y": 1.0, "scale_z": 1.0, **factors})


CHANGES = {
    "poisson_ratio": (SETUP, replace(SETUP, material=Material(poisson_ratio=0.4501))),
    "stiff_inclusion ratio": (_with_lump(), _with_lump(ratio=4.004)),
    "stiff_inclusion x": (_with_lump(), _with_lump(x=6.005e-3)),
    "stiff_inclusion radius": (_with_lump(), _with_lump(radius=6.003e-3)),
    "gravity": (
        replace(SETUP, load=Load(specific_weight_over_stiffness=1.5)),
        replace(SETUP, load=Load(specific_weight_over_stiffness=1.501)),
    ),
    "gravity from none": (SETUP, replace(SETUP, load=Load(specific_weight_over_stiffness=1e-3))),
    "base_detachment": (_with_detachment(0.02), _with_detachment(0.02001)),
    "tool_radius": (SETUP, replace(SETUP, tool=Tool(radius=5.0005e-3))),
    "tool_offset dx": (SETUP, replace(SETUP, tool=Tool(radius=5e-3, offset=(5e-7, 0.0, 0.0)))),
    "tool_offset dz": (SETUP, replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, 0.0, 5e-7)))),
    "base_slip": (SETUP, replace(SETUP, support=Support(friction_coefficient=2.0))),
    "surface_layer thickness": (
        _with("surface_layer", thickness=3e-3, stiffness_ratio=4.0),
        _with("surface_layer", thickness=3.003e-3, stiffness_ratio=4.0),
    ),
    "stiffness_gradient from none": (SETUP, _with("stiffness_gradient", log_ratio=1e-3)),
    "strain_stiffening": (_with("strain_stiffening", J_m=4.0), _with("strain_stiffening", J_m=4.004)),
    "anisotropy direction": (
        _with("anisotropy", direction=0.4, stiffness_ratio=3.0),
        _with("anisotropy", direction=0.401, stiffness_ratio=3.0),
    ),
    "anisotropy from none": (SETUP, _with("anisotropy", direction=0.4, stiffness_ratio=1.001)),
    "tool_compliance": (
        _with("tool_compliance", compliance_times_stiffness=20.0),
        _with("tool_compliance", compliance_times_stiffness=20.02),
    ),
    "tool_compliance from none": (SETUP, _with("tool_compliance", compliance_times_stiffness=0.02)),
    "offset of a tool that gives way": (
        _with("tool_compliance", compliance_times_stiffness=20.0),
        replace(SETUP, tool=Tool(radius=5e-3, offset=(0.0, 0.0, 5e-7), compliance_times_stiffness=20.0)),
    ),
    "stiffness under a tool that gives way": (
        _with("tool_compliance", compliance_times_stiffness=20.0),
        replace(_with("tool_compliance", compliance_times_stiffness=20.0), material=Material(poisson_ratio=0.4501)),
    ),
    "base_compliance": (_with("base_compliance", stiffness_over_E=60.0), _with("base_compliance", stiffness_over_E=60.06)),
    **{f"geometry_scale {axis}": (_scaled({}), _scaled({f"scale_{axis}": LARGER})) for axis in "xyz"},
    "geometry_scale of a heavy block": (
        replace(SETUP, load=Load(specific_weight_over_stiffness=1.5)),
        replace(_scaled({"scale_z": LARGER}), load=Load(specific_weight_over_stiffness=1.5)),
    ),
    "young_modulus": (SETUP, _with("young_modulus", E=7e3)),
    "landmark_mismatch": (SETUP, _with("landmark_mismatch", pairing="as-paired", scale=0.9, inset=1e-3)),
}
STILL = ("base_slip", "young_modulus", "landmark_mismatch")
"""What moves nothing while the tool stays where it is against the block."""


@pytest.mark.parametrize("name", CHANGES)
def test_sensitivity_is_the_difference_of_two_solves(name):
    setup, changed = CHANGES[name]
    grid = EVEN if name.startswith("geometry_scale") else GRID
    block, other = Replay(setup, grid, tolerance=1e-10), Replay(changed, grid, tolerance=1e-10)
    frame = None
    for centre in POKE:
        frame = block.step(centre, frame)
    assert frame is not None
    solved = other.step(POKE[-1], frame)
    wanted = solved.displacement - frame.displacement
    moved = displacement_changes(block, frame, [(changed, np.zeros(3))])
    found, pressed = moved[0], force_changes(block, frame, [(changed, np.zeros(3))], moved)[0]
    assert np.linalg.norm(pressed - (solved.force - frame.force)) < 0.02 * np.linalg.norm(solved.force - frame.force) + 1e-9
    if name in STILL:
        assert np.abs(found).max() < 1e-9 and np.abs(wanted).max() < 1e-9
        return
    assert np.linalg.norm(wanted) > 1e-7
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


@pytest.mark.parametrize("name", DEFORMING)
def test_adjoint_gradient_is_that_of_full_solves(name):
    effect = DEFORMING[name]
    block, frame = Replay(effect.apply(SETUP), GRID, tolerance=1e-11), None
    for centre in POKE:
        frame = block.step(centre, frame)
    assert frame is not None
    target = 0.8 * frame.displacement  # what was measured, as it were

    def loss(found: Equilibrium) -> float:
        return 0.5 * float(((found.displacement - target) ** 2).sum())

    for item, here in zip(effect.numbers(), effect.coordinates, strict=True):
        step, around = 1e-3 * item.scale, []
        for sign in (1, -1):
            changed = replace(effect, **{item.name: item.value(here + sign * step)}).apply(SETUP)
            solved = Replay(changed, GRID, tolerance=1e-11).step(POKE[-1], frame)
            assert solved.outcome.name == "CONVERGED"
            slope = frame.displacement - target
            around.append((loss(solved), loss_changes(block, frame, slope, [(changed, np.zeros(3))])[0]))
        (above, rise), (below, fall) = around
        assert rise - fall == pytest.approx(above - below, rel=0.01)


REMEMBERING = (
    Viscoelasticity(relaxed_fraction=0.3, time_constant=1.0),
    PermanentSet(retained_fraction=0.2),
    ToolFriction(friction_coefficient=0.3),
)


@pytest.mark.parametrize("effect", REMEMBERING, ids=lambda effect: effect.name)
def test_effect_that_remembers_has_no_change_of_one_frame_to_first_order(effect):
    """What it remembers changes in every frame before, so that asking for one alone is an error (see `core.adjoint`)."""
    block = Replay(SETUP, GRID)
    frame, setup = block.step(POKE[0]), effect.apply(SETUP)
    for ask in (displacement_changes, lambda *given: loss_changes(block, frame, frame.displacement, given[-1])):
        with pytest.raises(SetupError, match="of the whole replay"):
            ask(block, frame, [(setup, np.zeros(3))])


@pytest.mark.parametrize("giving", [0.0, 20.0], ids=["held", "giving"])
@pytest.mark.parametrize("axis", "xyz")
def test_adjoint_gradient_by_the_block_s_size_is_that_of_full_solves(axis, giving):
    """The displacement is that of the material point from where it is at rest in each block."""

    def sized(factor: float) -> Setup:
        setup = _scaled({f"scale_{axis}": factor})
        return replace(setup, tool=Tool(radius=5e-3, compliance_times_stiffness=giving))

    block = Replay(sized(1.0), EVEN, tolerance=1e-11)
    frames: list[Equilibrium] = []
    for centre in POKE:
        frames.append(block.step(centre, frames[-1] if frames else None))
    slope, step = 0.2 * frames[-1].displacement, 1e-5
    near = [(sized(1.0 + sign * step), np.zeros(3)) for sign in (1, -1)]
    around = [Replay(setup, EVEN, tolerance=1e-11).step(POKE[-1], frames[-1]).displacement for setup, _ in near]
    wanted = float((slope * (around[0] - around[1])).sum())
    rise, fall = loss_changes(block, frames[-1], slope, near)
    assert rise - fall == pytest.approx(wanted, rel=0.01)
    slopes = [np.zeros_like(slope), np.zeros_like(slope), slope]
    assert np.subtract(*replay_loss_changes(block, frames, slopes, near)) == pytest.approx(wanted, rel=0.01)


def test_grid_of_other_elements_and_a_size_that_is_remembered_have_no_gradient():
    block, frames = Replay(SETUP, GRID), [Replay(SETUP, GRID).step(POKE[0])]
    coarse = [(_with("mesh_resolution", element_size=6e-3), np.zeros(3))]
    slopes = [frame.displacement for frame in frames]
    for ask in (
        lambda: displacement_changes(block, frames[0], coarse),
        lambda: loss_changes(block, frames[0], slopes[0], coarse),
        lambda: replay_loss_changes(block, frames, slopes, coarse),
    ):
        with pytest.raises(SetupError, match="differences of whole replays") as caught:
            ask()
        assert caught.value.where["key"] == "element_size"
    kept = PermanentSet(retained_fraction=0.2)
    larger = [(kept.apply(_scaled({"scale_x": LARGER})), np.zeros(3))]
    with pytest.raises(SetupError, match="changes its size while it remembers"):
        replay_loss_changes(Replay(kept.apply(SETUP), GRID), frames, slopes, larger, [0.0])


def test_every_effect_that_deforms_the_block_has_its_gradient_checked_or_turned_down():
    turned_down = {*(effect.name for effect in REMEMBERING), "mesh_resolution"}
    checked = {*DEFORMING, *STILL, "geometry_scale", *turned_down}
    assert {effect.name for effect in CATALOGUE if effect.enters is not Slot.SENSOR} == checked
