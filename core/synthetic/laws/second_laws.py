"""The second law of each effect, and random choices between the two laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario

__all__ = ["SECOND_LAWS", "SecondLaw", "with_second_laws"]

_SHARE = 0.5
"""Probability of the second law [1]."""


@dataclass(frozen=True)
class SecondLaw:
    """Another law by which the bench can hide an effect.

    Attributes:
        summary: what differs from the catalogue's law.
        kept: names of the parameters that mean the same under both laws.
    """

    summary: str
    kept: tuple[str, ...] = ()


SECOND_LAWS: Mapping[str, SecondLaw] = {
    "poisson_ratio": SecondLaw("Poisson's ratio rises by 0.04 from bottom to top"),
    "stiff_inclusion": SecondLaw(
        "an ellipsoid, with half axes of 1.25, 0.85 and 0.94 times the radius", ("x", "y", "z")
    ),
    "tool_offset": SecondLaw("the offset grows by a fifth from the middle to either end"),
    "base_slip": SecondLaw("friction rises with the 0.85th power of the pressure"),
    "base_detachment": SecondLaw("the front of the loose strip is a parabola", ("edge",)),
    "gravity": SecondLaw("the bottom is 1.6 times as dense as the top"),
    "time_offset": SecondLaw("the offset drifts by a fifth in each sequence", ("offset",)),
    "camera_registration": SecondLaw("a sixth of the motion comes later, in two minutes"),
    "surface_layer": SecondLaw("stiffness falls off gradually below the layer"),
    "stiffness_gradient": SecondLaw("stiffness is linear in height, its logarithm is not"),
    "strain_stiffening": SecondLaw("an exponential law (Fung 1967) without a limit of stretch"),
    "anisotropy": SecondLaw("two families of fibres, 20 degrees to either side", ("direction",)),
    "base_compliance": SecondLaw("one end of the support is three times as stiff as the other"),
    "tool_compliance": SecondLaw("the shaft bends and is four times as stiff along its axis"),
    "depth_bias": SecondLaw("the scale grows with the depth"),
    "viscoelasticity": SecondLaw(
        "two terms, of a third and of three times the time constant", ("relaxed_fraction",)
    ),
    "permanent_set": SecondLaw(
        "the material flows above 3 % of strain, while strain grows or is held"
    ),
    "stiff_tube": SecondLaw(
        "the tube tapers, by a fifth to either side", ("aside", "z", "heading")
    ),
    "tool_friction": SecondLaw("the drag grows less than the pressure and has a limit"),
}
"""By name of the effect. The radius and the pairing of touches have one law. So have the sizes of
the block, whose form the nuisances change, its modulus, which alone does not show, and the offset
of a cast, which is random anyway."""


def with_second_laws(scenario: Scenario, seed: int) -> Scenario:
    """Choose between the two laws of each hidden effect, from a random stream of its own.

    Args:
        scenario: whose effects have the catalogue's kind of law.
        seed: of the stream.
    """
    random = np.random.default_rng([seed, 6607])
    effects = tuple(_with_law(one, bool(random.random() < _SHARE)) for one in scenario.effects)
    return replace(scenario, effects=effects)


def _with_law(hidden: HiddenEffect, second: bool) -> HiddenEffect:
    return replace(hidden, second_law=second and hidden.effect in SECOND_LAWS)
