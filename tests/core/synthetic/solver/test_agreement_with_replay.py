"""Effects of the virtual bench mean the same as the engine's of that name: both push one block
and agree.
"""

from __future__ import annotations

import numpy as np
import pytest
from virtual_push import X, Y, Z, hide, simulate_push, way

from palpate.effects import from_json
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay, require_converged
from palpate.setup.setup import Box, Material, Setup, Tool
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario

GRID = GridSpec(nodes=(17, 13, 9), spacing=1.4e-3, order=2)
DEPTH = 6e-3
STRONG = (
    (hide("surface_layer", thickness=2e-3, stiffness_ratio=5.0), False),
    (hide("stiffness_gradient", log_ratio=1.4), False),
    (hide("strain_stiffening", J_m=1.0), False),
    (hide("anisotropy", direction=0.5, stiffness_ratio=3.5), False),
    (hide("base_compliance", stiffness_over_E=30.0), True),
    (hide("tool_compliance", compliance_times_stiffness=30.0), True),
    (hide("geometry_scale", scale_x=0.96, scale_y=1.03, scale_z=0.94), False),
)
"""Each with whether it is pushed from the side."""


def _replayed(
    effects: tuple[HiddenEffect, ...], side: bool, places: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Displacement (n, 3) [m] of places at rest, and the force on the block (3,) [N]."""
    stated = Scenario()
    material = Material(young_modulus=stated.young_modulus, poisson_ratio=stated.poisson_ratio)
    setup = Setup(
        geometry=Box(size=(X, Y, Z)),
        tool=Tool(radius=stated.tool_radius),
        material=material,
        mass=stated.mass,
    )
    for hidden in effects:
        setup = from_json({"effect": hidden.effect, "parameters": dict(hidden.parameters)}).apply(
            setup
        )
    begin, end = way(DEPTH, side)
    frames = replay(
        setup, np.array([begin + share * (end - begin) for share in (0.45, 0.6, 0.8, 1.0)]), GRID
    )
    require_converged(frames)
    return frames[-1].move(places) - places, -frames[-1].force


def _size(field: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(field**2, axis=-1))))


@pytest.mark.parametrize("side", [False, True], ids=["from above", "from the side"])
def test_stiffer_block_takes_the_same_shape_and_pushes_back_in_proportion(side: bool) -> None:
    stiffer = hide("young_modulus", E=8e3)
    (true,), (plain,) = (
        simulate_push(*hidden, depth=DEPTH, side=side, fine=2.6e-3).solved_pushes
        for hidden in ((stiffer,), ())
    )
    replayed, force = _replayed((stiffer,), side, true.rest)
    last, stated = true.segments[0].key_frames[-1], plain.segments[0].key_frames[-1]
    assert _size(last.surface - stated.surface) < 2e-3 * _size(stated.surface)
    assert np.allclose(last.tool_force, 1.6 * stated.tool_force, rtol=5e-3, atol=1e-3)
    assert np.linalg.norm(last.tool_force - force) < 0.06 * np.linalg.norm(force)
    assert _size(last.surface - replayed) < 0.07 * _size(last.surface)
    at = true.segments[0]
    assert np.allclose(
        true.tool_force(np.array([at.begin, at.end])), [np.zeros(3), last.tool_force]
    )


@pytest.mark.parametrize(("effect", "side"), STRONG, ids=[one.effect for one, _ in STRONG])
def test_bench_and_replay_agree_on_a_push(effect: HiddenEffect, side: bool) -> None:
    solved = simulate_push(effect, depth=DEPTH, side=side, fine=2.6e-3).solved_pushes[0]
    true = solved.segments[0].key_frames[-1]
    replayed, force = _replayed((effect,), side, solved.rest)
    without, _ = _replayed((), side, solved.rest)
    assert _size(true.surface - replayed) < 0.07 * _size(true.surface)
    assert _size(true.surface - replayed) < 0.5 * _size(true.surface - without)
    assert np.linalg.norm(true.tool_force) == pytest.approx(float(np.linalg.norm(force)), rel=0.06)
