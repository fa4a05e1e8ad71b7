"""First-order changes of a replay by every effect, against solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from deforming import DEFORMING

from palpate.diagnosis.forward.jacobian import JacobianColumns, JacobianRequest
from palpate.effects import CATALOGUE, Slot, from_json
from palpate.effects.geometry import GeometryLocal
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity
from palpate.effects.tool import ToolFriction
from palpate.foundation.errors import SetupError
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.force_changes import force_changes
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.push_meshes import SCREEN_PUSHES
from palpate.replay.replay import Replay
from palpate.setup.setup import Box, Load, Material, Setup, Support, Tool
from palpate.synthetic.bodies.shape_families import draw_shape

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


def _with_tube(**other: float) -> Setup:
    """A setup with a bent tube, one of whose numbers may be another one."""
    axis = {"aside": 2e-3, "z": 0.025, "heading": 0.4, "inclination": 0.1, "bend": 6.0, "sag": -3.0}
    return _with("stiff_tube", **{**axis, "radius": 5e-3, "stiffness_ratio": 4.0, **other})


LARGER = 1.0 + 1e-5


def _scaled(factors: dict[str, float]) -> Setup:
    return _with("geometry_scale", **{"scale_x": 1.0, "scale_y": 1.0, "scale_z": 1.0, **factors})


CHANGES = {
    "poisson_ratio": (SETUP, replace(SETUP, material=Material(poisson_ratio=0.4501))),
    "stiff_inclusion ratio": (_with_lump(), _with_lump(ratio=4.004)),
    "stiff_inclusion x": (_with_lump(), _with_lump(x=6.005e-3)),
    "stiff_inclusion radius": (_with_lump(), _with_lump(radius=6.003e-3)),
    **{
        f"stiff_tube {name}": (_with_tube(), _with_tube(**{name: value}))
        for name, value in {
            "aside": 2.005e-3,
            "z": 0.025005,
            "heading": 0.4005,
            "inclination": 0.1005,
            "bend": 6.05,
            "sag": -2.95,
            "radius": 5.003e-3,
            "stiffness_ratio": 4.004,
        }.items()
    },
    "stiff_tube that was straight": (_with_tube(bend=0.0, sag=0.0), _with_tube(bend=0.02, sag=0.0)),
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
    "strain_stiffening": (
        _with("strain_stiffening", J_m=4.0),
        _with("strain_stiffening", J_m=4.004),
    ),
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
        replace(
            SETUP, tool=Tool(radius=5e-3, offset=(0.0, 0.0, 5e-7), compliance_times_stiffness=20.0)
        ),
    ),
    "stiffness under a tool that gives way": (
        _with("tool_compliance", compliance_times_stiffness=20.0),
        replace(
            _with("tool_compliance", compliance_times_stiffness=20.0),
            material=Material(poisson_ratio=0.4501),
        ),
    ),
    "base_compliance": (
        _with("base_compliance", stiffness_over_E=60.0),
        _with("base_compliance", stiffness_over_E=60.06),
    ),
    **{
        f"geometry_scale {axis}": (_scaled({}), _scaled({f"scale_{axis}": LARGER}))
        for axis in "xyz"
    },
    "geometry_scale of a heavy block": (
        replace(SETUP, load=Load(specific_weight_over_stiffness=1.5)),
        replace(_scaled({"scale_z": LARGER}), load=Load(specific_weight_over_stiffness=1.5)),
    ),
    "young_modulus": (SETUP, _with("young_modulus", E=7e3)),
    "landmark_mismatch": (
        SETUP,
        _with("landmark_mismatch", pairing="as-paired", scale=0.9, inset=1e-3),
    ),
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
    assert (
        np.linalg.norm(pressed - (solved.force - frame.force))
        < 0.02 * np.linalg.norm(solved.force - frame.force) + 1e-9
    )
    if name in STILL:
        assert np.abs(found).max() < 1e-9 and np.abs(wanted).max() < 1e-9
        return
    assert np.linalg.norm(wanted) > 1e-7
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


REMEMBERING = (
    Viscoelasticity(relaxed_fraction=0.3, time_constant=1.0),
    PermanentSet(retained_fraction=0.2),
    ToolFriction(friction_coefficient=0.3),
)


@pytest.mark.parametrize("effect", REMEMBERING, ids=lambda effect: effect.name)
def test_effect_that_remembers_has_no_change_of_one_frame_to_first_order(effect):
    """What it remembers changes in every frame before, so that asking for one alone is an error
    ."""
    block = Replay(SETUP, GRID)
    frame, setup = block.step(POKE[0]), effect.apply(SETUP)
    with pytest.raises(SetupError, match="of the whole replay"):
        displacement_changes(block, frame, [(setup, np.zeros(3))])


def test_grid_of_other_elements_has_no_gradient():
    block, frame = Replay(SETUP, GRID), Replay(SETUP, GRID).step(POKE[0])
    coarse = [(_with("mesh_resolution", element_size=6e-3), np.zeros(3))]
    with pytest.raises(SetupError, match="differences of whole replays") as caught:
        displacement_changes(block, frame, coarse)
    assert caught.value.where["key"] == "element_size"


DOME = draw_shape("dome", 3)
TOP = np.array([[4e-3, 2e-3, float(DOME.heights(np.array([[4e-3, 2e-3]]))[0])]])


def _cast(*coefficients: float) -> Setup:
    return GeometryLocal.of(coefficients).apply(Setup(geometry=DOME, tool=Tool(radius=5e-3)))


@pytest.mark.parametrize(
    ("setup", "changed"),
    [(_cast(), _cast(2e-6)), (_cast(4e-4, 3e-4), _cast(4.02e-4, 3e-4))],
    ids=["from none", "from one"],
)
def test_sensitivity_to_the_cast_is_the_difference_of_two_solves(setup, changed):
    grid = SCREEN_PUSHES.at(TOP)
    block, other = Replay(setup, grid, tolerance=1e-10), Replay(changed, grid, tolerance=1e-10)
    frame = None
    for depth in (1e-3, 3e-3):
        frame = block.step(TOP[0] + [0.0, 0.0, 5e-3 - depth], frame)
    assert frame is not None
    solved = other.step(frame.tool.centre, frame)
    wanted = solved.displacement - frame.displacement
    found = displacement_changes(block, frame, [(changed, np.zeros(3))])[0]
    assert np.linalg.norm(wanted) > 1e-7
    assert np.linalg.norm(found - wanted) < 0.03 * np.linalg.norm(wanted)
    # A diagnosis takes the surface under the tool to be a tool that comes as much nearer.
    request = JacobianRequest(setups=(changed,), steps=(2e-6,), pivot=np.zeros(3))
    columns = JacobianColumns(block, request, forces=False)
    quick = 2e-6 * columns.changes(frame, np.zeros((1, 3)))[6, :-1]
    alike = (quick * wanted).sum() / (np.linalg.norm(quick) * np.linalg.norm(wanted))
    assert alike > 0.9 and np.linalg.norm(quick) == pytest.approx(np.linalg.norm(wanted), rel=0.3)


def test_every_effect_that_deforms_the_block_has_its_gradient_checked_or_turned_down():
    turned_down = {*(effect.name for effect in REMEMBERING), "mesh_resolution"}
    checked = {*DEFORMING, *STILL, "geometry_scale", "geometry_local", *turned_down}
    assert {effect.name for effect in CATALOGUE if effect.enters is not Slot.SENSOR} == checked
