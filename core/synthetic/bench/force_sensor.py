"""A force sensor in the tool with white noise, a drifting bias and a gain error.

A ball of 5 mm pressed 3 to 8 mm into a gel of 5 kPa meets 0.1 to 0.5 N. Small six-axis sensors
resolve some 3 mN there (ATI Nano17, maker's data). In a driven tool the motors' vibration adds a
multiple of it, so 20 mN a sample is a middle value. Forces estimated from the motor currents of a
cable-driven arm are off by tenths of a newton, which is too much for such a gel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["FORCE_NOISE", "ForceSensor"]

FORCE_NOISE = 20e-3
"""Default standard deviation of one sample [N]."""
RATE = 250.0
"""Samples per second [1/s]."""
_BIAS, _DRIFT, _GAIN = 50e-3, 2e-3, 0.01
"""Largest bias of an axis [N], its random walk [N per square root of a second], and the gain's
standard deviation [1]."""


@dataclass(frozen=True)
class ForceSensor:
    """One sensor, the same in all sequences of a dataset.

    Attributes:
        noise: standard deviation of one sample [N].
        gain: reading over force [1].
    """

    noise: float
    gain: float

    @classmethod
    def draw(cls, noise: float, rng: np.random.Generator) -> ForceSensor:
        """Draw a sensor with a gain error of 1 %, as calibrations leave it."""
        return cls(noise, 1.0 + _GAIN * float(rng.standard_normal()))

    def instants(self, duration: float, rng: np.random.Generator) -> FloatArray:
        """Sampling times (n,) [s] at RATE with jitter, strictly increasing."""
        times = (
            np.cumsum(np.clip(1 + 0.05 * rng.normal(size=int(duration * RATE)), 0.5, 1.5)) / RATE
        )
        return np.unique(np.round(times[times < duration], 5))

    def read(self, times: FloatArray, force: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Readings (n, 3) [N] of a force (n, 3) [N], with a random-walk bias and white noise."""
        steps = (
            rng.normal(size=force.shape)
            * _DRIFT
            * np.sqrt(np.diff(times, prepend=times[0]))[:, None]
        )
        bias = rng.uniform(-_BIAS, _BIAS, 3) + np.cumsum(steps, axis=0)
        return np.asarray(self.gain * force + bias + self.noise * rng.normal(size=force.shape))
