"""True material, supports and tool of the virtual block, from what a scenario hides."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.laws.stiffness_fields import (
    fibre_families,
    gradient_factor,
    in_inclusion,
    in_tube,
    layer_factor,
    uneven_density,
    uneven_poisson_ratio,
    wave_factor,
)
from palpate.synthetic.laws.support_laws import is_bonded, side_of, spring_factor
from palpate.synthetic.laws.tool_laws import offset_at
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.holzapfel_fibres import fibre_modulus
from palpate.synthetic.solver.inelastic_history import relaxed_share
from palpate.synthetic.solver.obstacles import Neighbour, Shaft, shaft_radius
from palpate.synthetic.solver.solid_model import SolidModel
from palpate.synthetic.solver.tet_block import TetBlock

__all__ = [
    "base_seams",
    "creep_velocity",
    "material_levels",
    "solid_model",
    "true_offset",
    "true_radius",
]

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]


def true_radius(scenario: Scenario) -> float:
    """True radius of the tool [m]."""
    hidden = scenario.hidden("tool_radius")
    return hidden.value("radius") if hidden else scenario.tool_radius


def true_offset(scenario: Scenario, centre: FloatArray) -> FloatArray:
    """True minus stated centre (..., 3) of the tool before anything is touched, phantom frame [m].

    Args:
        scenario: with the hidden offset.
        centre: (..., 3) stated centre [m].
    """
    return offset_at(scenario.hidden("tool_offset"), centre, scenario.size[0])


def creep_velocity(scenario: Scenario) -> FloatArray:
    """Velocity of the block on its table (3,) [m/s]."""
    creep = scenario.disturbance("phantom_creep")
    if creep is None:
        return np.zeros(3)
    direction = creep.value("direction")
    return creep.value("speed") * np.array([np.cos(direction), np.sin(direction), 0.0])


def material_levels(scenario: Scenario) -> tuple[float, ...]:
    """Heights of boundaries between materials [m]: the lower side of a skin layer, if any."""
    skin = scenario.hidden("surface_layer")
    return (scenario.true_size[2] - skin.value("thickness"),) if skin else ()


def base_seams(
    scenario: Scenario, low: FloatArray | None = None, high: FloatArray | None = None
) -> tuple[tuple[int, float], ...]:
    """Axis and position [m] of the edge of a detached strip of the base, to which the mesh is
    aligned.

    Args:
        scenario: that hides it.
        low: lowest corner (3,) of the body's bounding box [m]; that of the block without it.
        high: highest corner (3,) [m]; that of the block without it.
    """
    strip = scenario.hidden("base_detachment")
    if strip is None:
        return ()
    axis, sign = side_of(str(strip.parameters["edge"]))
    half = scenario.true_size[axis] / 2
    ends = (-half if low is None else low[axis], half if high is None else high[axis])
    return ((axis, float(ends[sign > 0] - sign * strip.value("extent"))),)


def solid_model(scenario: Scenario, block: TetBlock, axis: FloatArray | None = None) -> SolidModel:
    """The solid that fills `block`, with everything that touches it.

    Args:
        scenario: what is believed and hidden.
        block: its mesh.
        axis: (3,) unit vector from the shaft towards the tip; None without a shaft.
    """
    nu, weight = scenario.hidden("poisson_ratio"), scenario.hidden("gravity")
    limit, fibres, springs = (
        scenario.hidden(name) for name in ("strain_stiffening", "anisotropy", "base_compliance")
    )
    poisson_ratio = nu.value("nu") if nu else scenario.poisson_ratio
    height = block.places[..., 2] / scenario.true_size[2]
    held = (block.nodes[:, 2] < 1e-9) & _bonded(scenario, block, block.nodes)
    return SolidModel(
        young_modulus=_modulus(scenario, block),
        poisson_ratio=poisson_ratio + uneven_poisson_ratio(nu, height),
        weight=weight.value("specific_weight_over_stiffness")
        * scenario.true_modulus
        * uneven_density(weight, height)
        if weight
        else 0.0,
        held=np.zeros_like(held) if springs else held,
        tool_radius=true_radius(scenario),
        lifts=scenario.hidden("base_detachment") is not None,
        stretch_limit=limit.value("J_m") if limit else None,
        exponential=limit is not None and limit.second_law,
        fibres=fibre_families(fibres),
        fibre_modulus=fibre_modulus(fibres.value("stiffness_ratio"), poisson_ratio)
        if fibres
        else 0.0,
        springs=_springs(scenario, block, springs) if springs else None,
        relaxed=relaxed_share(scenario),
        shaft=_shaft(scenario, axis),
        neighbour=_neighbour(scenario),
    )


def _shaft(scenario: Scenario, axis: FloatArray | None) -> Shaft | None:
    """The shaft as an obstacle; None unless the scenario lets it touch the block."""
    if axis is None or scenario.disturbance("shaft_contact") is None:
        return None
    return Shaft(-axis, shaft_radius(true_radius(scenario)), 2 * scenario.true_size[2])


def _neighbour(scenario: Scenario) -> Neighbour | None:
    body = scenario.disturbance("second_body")
    if body is None:
        return None
    axis, sign = side_of(str(body.parameters["side"]))
    return Neighbour(
        axis, sign, body.value("overlap"), body.value("stiffness_over_E") * scenario.true_modulus
    )


def _modulus(scenario: Scenario, block: TetBlock) -> FloatArray:
    """Young's modulus (e, 4) at the volume points [Pa]."""
    modulus = np.full(block.weights.shape, scenario.true_modulus)
    lump, tube, skin, slope = (
        scenario.hidden(name)
        for name in ("stiff_inclusion", "stiff_tube", "surface_layer", "stiffness_gradient")
    )
    height = scenario.true_size[2]
    if lump is not None:
        modulus[in_inclusion(lump, block.places)] *= lump.value("stiffness_ratio")
    if tube is not None:
        low, high = _bounding_box(block)
        modulus[in_tube(tube, block.places, (low + high)[:2] / 2)] *= tube.value("stiffness_ratio")
    if skin is not None:
        below = height - block.places[..., 2] if block.below_skin is None else block.below_skin
        modulus *= layer_factor(skin, below)
    if slope is not None:
        modulus *= gradient_factor(slope, block.places[..., 2] / height)
    if (waves := scenario.disturbance("stiffness_waves")) is not None:
        modulus *= wave_factor(waves, block.places)
    return modulus


def _bounding_box(block: TetBlock) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner (3,) [m] of the body's own surface; its mesh cuts corners."""
    return block.surface_rest.min(axis=0), block.surface_rest.max(axis=0)


def _bonded(scenario: Scenario, block: TetBlock, places: FloatArray) -> BoolArray:
    """Mask (...) of places (..., 3) [m] of the base that are not detached.

    A strip is measured inwards from the body's bounding box.
    """
    low, high = _bounding_box(block)
    x, y, z = (high - low).tolist()
    middle = np.array([*(low + high)[:2] / 2, 0.0])
    return is_bonded(scenario.hidden("base_detachment"), places - middle, (x, y, z))


def _springs(scenario: Scenario, block: TetBlock, hidden: HiddenEffect) -> FloatArray:
    """Stiffness per area (f, q) [N/m^3] at the points of the base; zero where it is detached."""
    places = np.einsum(
        "fqa,fai->fqi", block.sole.values, block.nodes[block.elements[block.sole.owner]]
    )
    stiffness = hidden.value("stiffness_over_E") * scenario.true_modulus
    even = np.where(_bonded(scenario, block, places), stiffness, 0.0)
    return np.asarray(even * spring_factor(hidden, places, scenario.true_size))
