"""What goes wrong outside the catalogue: nothing there expresses it, so that a diagnosis should name nothing alone for it.

A camera that warms up turns and shifts while a sequence lasts, registered half way; and depth that ripples with the distance, as
interference between cameras leaves it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from core.frames import FloatArray, Transform
from core.synthetic.naming import check_named

__all__ = ["DISTURBANCES", "Disturbance", "draw_disturbance", "drifted", "rippled"]

DISTURBANCES: Mapping[str, Mapping[str, str]] = {
    "camera_drift": {"translation": "m", "rotation": "rad"},
    "depth_ripple": {"amplitude": "1", "period": "m"},
}
"""Those the virtual bench can make, with the unit of each parameter.

`camera_drift`: how far the camera is off at a sequence's end, by which it was off the other way at its beginning. `depth_ripple`:
depth z is read as z (1 + amplitude sin(2 pi z / period)).
"""
_CLEAR: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "camera_drift": {"translation": (1.0e-3, 2.0e-3), "rotation": (0.008, 0.016)},
    "depth_ripple": {"amplitude": (1.5e-3, 3.0e-3), "period": (14e-3, 24e-3)},
}


@dataclass(frozen=True)
class Disturbance:
    """One by its name, with its parameters in SI units."""

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_named(self.name, self.parameters, DISTURBANCES, "disturb by")


def draw_disturbance(name: str, seed: int) -> Disturbance:
    """One of a clear size; EffectError for an unknown name."""
    rng = np.random.default_rng([seed, 104729])
    ranges = _CLEAR.get(name, {})
    return Disturbance(name, {key: round(float(rng.uniform(*span)), 5) for key, span in ranges.items()})


def drifted(disturbances: Sequence[Disturbance], share: float, rng: np.random.Generator) -> Transform:
    """The camera's motion, phantom frame, when a share [1] of a sequence is over; the same directions from the same generator."""
    step, turn = rng.normal(size=(2, 3))
    for one in disturbances:
        if one.name == "camera_drift":
            size = 2.0 * share - 1.0
            step *= size * one.parameters["translation"] / np.linalg.norm(step)
            return Transform.from_vector(step, turn * size * one.parameters["rotation"] / np.linalg.norm(turn))
    return Transform()


def rippled(disturbances: Sequence[Disturbance], depth: FloatArray) -> FloatArray:
    """What a camera reads (n,) [m] for these true depths (n,) [m]."""
    for one in disturbances:
        if one.name == "depth_ripple":
            depth = depth * (1.0 + one.parameters["amplitude"] * np.sin(2 * np.pi * depth / one.parameters["period"]))
    return depth
