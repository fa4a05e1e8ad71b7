"""Axes and parameter spaces: validation, and the setup of a point."""

from __future__ import annotations

import pytest

from palpate.foundation.errors import EffectError
from palpate.setup.setup import Box, Setup, Tool
from palpate.sweep import Axis, ParameterSpace

NU = Axis("poisson_ratio.nu", 0.3, 0.49)
SETUP = Setup(geometry=Box(size=(0.07, 0.04, 0.036)), tool=Tool(radius=5e-3))


@pytest.mark.parametrize(
    ("name", "low", "high", "message"),
    [
        ("poisson.nu", 0.3, 0.4, "no effect is called"),
        ("poisson_ratio.mu", 0.3, 0.4, "poisson_ratio.nu"),
        ("poisson_ratio.nu", 0.4, 0.3, "no range"),
        ("poisson_ratio.nu", 0.3, 0.6, "outside 0 to 0.495"),
        ("poisson_ratio.nu", float("nan"), 0.4, "no range"),
        ("base_detachment.edge", 0.0, 1.0, "is not a number"),
    ],
)
def test_invalid_axis_is_refused(name: str, low: float, high: float, message: str) -> None:
    with pytest.raises(EffectError, match=message):
        Axis(name, low, high)


def test_setup_has_swept_and_fixed_values() -> None:
    setup = ParameterSpace((NU,), {"gravity.specific_weight_over_stiffness": 1.5}).setup(
        SETUP, {NU.name: 0.41}
    )
    assert (setup.material.poisson_ratio, setup.load.specific_weight_over_stiffness) == (0.41, 1.5)


def test_line_of_a_modulus_is_evenly_spaced_in_its_logarithm() -> None:
    assert Axis("young_modulus.E", 1e3, 1e5).line(3) == pytest.approx([1e3, 1e4, 1e5])


def test_effects_of_a_point_have_the_fixed_values_and_the_stated_ones() -> None:
    size = Axis("geometry_scale.scale_x", 0.9, 1.1)
    space = ParameterSpace((size,), {"geometry_scale.scale_z": 1.02})
    (effect,) = space.effects(SETUP, {size.name: 0.95})
    assert effect.values() == {"scale_x": 0.95, "scale_y": 1.0, "scale_z": 1.02}
