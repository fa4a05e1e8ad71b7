"""Disturbances outside the catalogue of effects.

No effect expresses them, so a diagnosis should name no single cause. A camera that warms up turns
and shifts during a sequence and is exact half way. Depth ripples with the distance, as interference
between cameras causes it. The phantom creeps sideways on its table. Another soft body lies against
a side that the camera does not see. The shaft of an upright tool touches the rim of the top while
its ball is pushed into a side. Stiffness goes up and down in waves across the body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.synthetic.scenario.parameter_names import check_named

__all__ = [
    "DISTURBANCES",
    "OF_ANY_BODY",
    "WEIGHED_DISTURBANCES",
    "Disturbance",
    "draw_disturbance",
    "drifted",
    "rippled",
]

DISTURBANCES: Mapping[str, Mapping[str, str]] = {
    "camera_drift": {"translation": "m", "rotation": "rad"},
    "depth_ripple": {"amplitude": "1", "period": "m"},
    "phantom_creep": {"speed": "m/s", "direction": "rad"},
    "second_body": {"overlap": "m", "stiffness_over_E": "1/m", "side": ""},
    "shaft_contact": {"lean": "rad"},
    "stiffness_waves": {"amplitude": "1", "period": "m", "direction": "rad", "phase": "rad"},
}
"""Disturbances of the virtual bench, with the unit of each parameter.

`camera_drift`: pose error of the camera at the end of a sequence; it is the opposite at the
beginning. `depth_ripple`: depth z is read as z (1 + amplitude sin(2 pi z / period)).
`phantom_creep`: speed and direction (in the plane, from x) of the block during a sequence; it is
put back after each. `second_body`: its overlap with the block if it were rigid, its pressure per
displacement over the block's modulus, and the side it lies against, which the camera does not see;
it is black, so the camera does not see it either. `shaft_contact`: angle of the shaft from the
vertical, over the block, in pushes from the side. `stiffness_waves`: the logarithm of the stiffness
is amplitude sin(2 pi s / period + phase) at a way s along the direction (in the plane, from x).
"""
OF_ANY_BODY = ("camera_drift", "depth_ripple", "phantom_creep")
"""Those that any body can have: a second body needs an upright side to lie against, and a shaft the
rim of a level top."""
WEIGHED_DISTURBANCES = tuple(name for name in DISTURBANCES if name != "stiffness_waves")
"""The disturbances that suites draw from; waves of stiffness are made where they are asked for, so
that a seed draws what it always drew."""
_Range = tuple[float, float] | tuple[str, str, str, str]
_CLEAR: Mapping[str, Mapping[str, _Range]] = {
    "camera_drift": {"translation": (1.0e-3, 2.0e-3), "rotation": (0.008, 0.016)},
    "depth_ripple": {"amplitude": (1.5e-3, 3.0e-3), "period": (14e-3, 24e-3)},
    "phantom_creep": {"speed": (4e-5, 9e-5), "direction": (0.0, 6.28)},
    "second_body": {
        "overlap": (1.5e-3, 3.0e-3),
        "stiffness_over_E": (60.0, 150.0),
        "side": ("-x", "+x", "-y", "+y"),
    },
    "shaft_contact": {"lean": (0.0, 0.12)},
    "stiffness_waves": {
        "amplitude": (0.4, 0.7),
        "period": (40e-3, 60e-3),
        "direction": (0.0, 3.14),
        "phase": (0.0, 6.28),
    },
}


@dataclass(frozen=True)
class Disturbance:
    """A disturbance.

    Attributes:
        name: one of DISTURBANCES.
        parameters: by name, SI units.
    """

    name: str
    parameters: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_named(self.name, self.parameters, DISTURBANCES, "disturb by")

    def value(self, name: str) -> float:
        """The numeric parameter of this name."""
        return float(self.parameters[name])


def draw_disturbance(name: str, seed: int) -> Disturbance:
    """Draw a disturbance of a clear size; EffectError for an unknown name."""
    rng = np.random.default_rng([seed, 104729])
    return Disturbance(name, {key: _drawn(span, rng) for key, span in _CLEAR.get(name, {}).items()})


def _drawn(span: _Range, rng: np.random.Generator) -> float | str:
    """Draw a number from a range, rounded, or one of several words."""
    if len(span) > 2:
        return str(rng.choice(np.array(span)))
    low, high = (float(end) for end in span)
    return round(float(rng.uniform(low, high)), 7 if high < 1e-3 else 5)


def drifted(
    disturbances: Sequence[Disturbance], share: float, rng: np.random.Generator
) -> Transform:
    """Drift of the camera, phantom frame, after a share [1] of a sequence; generators in the same
    state give the same directions.
    """
    step, turn = rng.normal(size=(2, 3))
    for one in disturbances:
        if one.name == "camera_drift":
            size = 2.0 * share - 1.0
            step *= size * one.value("translation") / np.linalg.norm(step)
            return Transform.from_vector(
                step, turn * size * one.value("rotation") / np.linalg.norm(turn)
            )
    return Transform()


def rippled(disturbances: Sequence[Disturbance], depth: FloatArray) -> FloatArray:
    """Depth readings (n,) [m] of a disturbed camera for true depths (n,) [m]."""
    for one in disturbances:
        if one.name == "depth_ripple":
            depth = depth * (
                1.0 + one.value("amplitude") * np.sin(2 * np.pi * depth / one.value("period"))
            )
    return depth
