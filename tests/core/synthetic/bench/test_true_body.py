"""Material and supports of the virtual block against columns and balances in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from virtual_push import RADIUS, X, Y, Z, hide, simulate_push, way

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.true_body import base_seams, material_levels, solid_model
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.tet_block import TetBlock, TetGrading, mesh_block
from palpate.synthetic.solver.tet_equilibrium import TetSolver

WEIGHT = 0.02
"""Over E [1/m]: so light that strains add up."""


def _block(scenario: Scenario) -> TetBlock:
    return mesh_block(
        scenario.size,
        TetGrading(
            np.zeros((1, 3)), np.zeros(1), np.full(1, 8e-3), 8e-3, levels=material_levels(scenario)
        ),
    )


def _modulus(*effects: HiddenEffect) -> tuple[FloatArray, FloatArray]:
    """Over the stated one, and the heights of the points [m]."""
    scenario = Scenario(effects=effects)
    block = _block(scenario)
    return solid_model(scenario, block).young_modulus / scenario.young_modulus, block.places[..., 2]


def _sag(*effects: HiddenEffect) -> float:
    """Sag of the top of a column without Poisson effect [m]."""
    gravity = hide("gravity", specific_weight_over_stiffness=WEIGHT)
    rest, settled, _ = rest_surface(Scenario(effects=(gravity, *effects), poisson_ratio=0.0))
    return -float(settled[rest[:, 2] > Z - 1e-9, 2].mean())


def test_skin_lies_on_the_top_and_no_element_crosses_its_lower_side() -> None:
    skin = hide("surface_layer", thickness=2e-3, stiffness_ratio=5.0)
    modulus, heights = _modulus(skin)
    assert np.array_equal(modulus == 5.0, heights > Z - 2e-3)
    assert set(np.unique(modulus)) == {1.0, 5.0}
    assert all(len(set(of_element)) == 1 for of_element in modulus)


def test_gradient_keeps_the_geometric_mean() -> None:
    modulus, heights = _modulus(hide("stiffness_gradient", log_ratio=1.2))
    slope, middle = np.polyfit((heights / Z - 0.5).ravel(), np.log(modulus).ravel(), 1)
    assert (slope, middle) == pytest.approx((1.2, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    "effect",
    [
        hide("surface_layer", thickness=2e-3, stiffness_ratio=1.0),
        hide("stiffness_gradient", log_ratio=0.0),
    ],
)
def test_skin_as_stiff_as_the_rest_and_level_gradient_change_no_modulus(
    effect: HiddenEffect,
) -> None:
    modulus, _ = _modulus(effect)
    assert np.all(modulus == 1.0)


@pytest.mark.parametrize("ratio", [0.25, 6.0])
def test_column_with_a_skin_sags_as_the_closed_form(ratio: float) -> None:
    deep, thin = Z - 3e-3, 3e-3
    wanted = WEIGHT * (deep * thin + deep**2 / 2 + thin**2 / (2 * ratio))
    assert _sag(hide("surface_layer", thickness=thin, stiffness_ratio=ratio)) == pytest.approx(
        wanted, rel=5e-3
    )


@pytest.mark.parametrize("log_ratio", [-1.5, 1.5])
def test_column_with_a_gradient_sags_as_the_closed_form(log_ratio: float) -> None:
    wanted, _ = quad(lambda z: WEIGHT * (Z - z) / np.exp(log_ratio * (z / Z - 0.5)), 0.0, Z)
    assert _sag(hide("stiffness_gradient", log_ratio=log_ratio)) == pytest.approx(wanted, rel=5e-3)


def test_column_on_springs_sinks_further_by_its_weight_over_their_stiffness() -> None:
    springs = hide("base_compliance", stiffness_over_E=30.0)
    assert _sag(springs) - _sag() == pytest.approx(WEIGHT * Z / 30.0, rel=2e-3)


def _pull(solver: TetSolver, displacement: FloatArray) -> FloatArray:
    """Force (3,) [N] of the springs on the block."""
    return -np.einsum("fab,fbi->i", solver.body.springs, displacement[solver.body.sole])


def test_springs_carry_what_the_tool_pushes() -> None:
    scenario = Scenario(effects=(hide("base_compliance", stiffness_over_E=30.0),))
    block = mesh_block(
        scenario.size,
        TetGrading(np.array([[4e-3, Y / 2, 0.023]]), np.array([0.8 * RADIUS]), np.array([3.6e-3])),
    )
    solver = TetSolver(block, solid_model(scenario, block))
    state = solver.rest
    for depth in (1e-3, 2e-3, 3e-3):
        state = solver.state(way(depth, side=True)[1], state)
    solver.close()
    assert np.linalg.norm(state.tool_force) > 0.05
    assert _pull(solver, state.displacement) == pytest.approx(
        -state.tool_force, abs=1e-3 * float(np.linalg.norm(state.tool_force))
    )


def test_springs_hold_only_what_is_not_loose() -> None:
    strip = hide("base_detachment", edge="+x", extent=0.015)
    scenario = Scenario(effects=(strip, hide("base_compliance", stiffness_over_E=30.0)))
    solid = solid_model(scenario, _block(scenario))
    assert solid.lifts
    assert solid.springs is not None
    assert 0.1 < float(np.mean(solid.springs == 0)) < 0.5
    assert not np.any(solid.held)


NEUTRAL = (
    hide("strain_stiffening", J_m=1e7),
    hide("anisotropy", direction=0.4, stiffness_ratio=1.0),
    hide("base_compliance", stiffness_over_E=1e7),
    hide("tool_compliance", compliance_times_stiffness=0.0),
    hide("stiffness_gradient", log_ratio=0.0),
)


@pytest.mark.parametrize("effect", NEUTRAL, ids=[one.effect for one in NEUTRAL])
def test_neutral_effects_change_nothing(effect: HiddenEffect) -> None:
    plain, same = (
        simulate_push(*effects).solved_pushes[0].segments[0].key_frames[-1]
        for effects in ((), (effect,))
    )
    assert np.abs(plain.surface).max() > 2e-3
    assert same.surface == pytest.approx(plain.surface, abs=3e-7)
    assert same.tool_force == pytest.approx(
        plain.tool_force, abs=1e-4 * float(np.linalg.norm(plain.tool_force))
    )


def test_skin_as_stiff_as_the_rest_changes_no_more_than_another_grid_does() -> None:
    plain, skin = (
        simulate_push(*effects).solved_pushes[0].segments[0].key_frames[-1]
        for effects in ((), (hide("surface_layer", thickness=2e-3, stiffness_ratio=1.0),))
    )
    assert np.linalg.norm(skin.tool_force) == pytest.approx(
        float(np.linalg.norm(plain.tool_force)), rel=0.01
    )


def test_fibres_lie_along_the_stated_direction() -> None:
    def spread(direction: float) -> FloatArray:
        """Bulge of the sides along x and y under a push from above [m]."""
        solved = simulate_push(
            hide("anisotropy", direction=direction, stiffness_ratio=4.0)
        ).solved_pushes[0]
        surface = solved.segments[0].key_frames[-1].surface
        return np.array(
            [
                surface[solved.rest[:, axis] > half - 1e-9, axis].max()
                for axis, half in enumerate((X / 2, Y / 2))
            ]
        )

    along_x, along_y = spread(0.0), spread(np.pi / 2)
    assert along_x[0] < 0.8 * along_y[0]
    assert along_y[1] < 0.8 * along_x[1]


@pytest.mark.parametrize(("edge", "axis", "side"), [("-y", 1, -1), ("+x", 0, 1)])
def test_a_loose_strip_ends_at_a_row_of_nodes_of_its_own(edge: str, axis: int, side: int) -> None:
    scenario = Scenario(
        effects=(HiddenEffect("base_detachment", {"edge": edge, "extent": 0.0133}),)
    )
    line = side * (scenario.size[axis] / 2 - 0.0133)
    ((across, place),) = base_seams(scenario)
    assert across == axis and place == pytest.approx(line)
    grading = TetGrading(
        np.zeros((1, 3)), np.zeros(1), np.full(1, 8e-3), seams=base_seams(scenario)
    )
    block = mesh_block(scenario.size, grading)
    held = solid_model(scenario, block).held
    base = block.nodes[:, 2] < 1e-9
    inwards = scenario.size[axis] / 2 - side * block.nodes[:, axis]
    assert inwards[held].min() == pytest.approx(0.0133)
    assert (inwards[base & ~held] < 0.0133).all() and inwards[base & ~held].max() > 0.0133 - 2.2e-3
