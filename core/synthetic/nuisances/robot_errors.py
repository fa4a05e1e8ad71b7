"""Errors of the tool's position as a robot states it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import Nuisance, StatedMotion
from palpate.synthetic.nuisances.random_waves import WAVES, sum_of_waves

__all__ = ["Backlash", "CableStretch", "CalibrationError", "EncoderSteps", "RobotRate"]

_STANDING = 0.2e-3
"""Speed below which a tool stands still [m/s]."""


@dataclass(frozen=True)
class Backlash(Nuisance):
    """Play between motor and tool: on the way back the stated position is off by its width.

    Cable-driven arms have tenths of a millimetre after calibration (Hwang et al. 2020: 0.65 mm in
    all after, 2.96 mm before).

    Attributes:
        width: of the play [m].
    """

    width: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 0.02 to 0.2 mm."""
        return cls(float(rng.uniform(0.02e-3, 0.2e-3)))

    def stated(self, motion: StatedMotion) -> FloatArray:
        """State half the width ahead of the tool, in the direction of its last motion."""
        speed = np.linalg.norm(motion.velocities, axis=1)
        moving = speed > _STANDING
        last = np.maximum.accumulate(np.where(moving, np.arange(len(speed)), -1))
        ahead = motion.velocities[last] / np.maximum(speed[last], _STANDING)[:, None]
        return np.asarray(
            motion.centres + 0.5 * self.width * np.where(last >= 0, 1.0, 0.0)[:, None] * ahead
        )


@dataclass(frozen=True)
class CableStretch(Nuisance):
    """Cables stretch under load, more across the shaft than along it (Hwang et al. 2020).

    Attributes:
        across: stretch across the shaft [m/N].
        along: along it [m/N].
    """

    causes = ("tool_compliance",)
    across: float
    along: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 2 to 4 mm/N across and a third to all of it along the shaft."""
        across = float(rng.uniform(2e-3, 4e-3))
        return cls(across, across * float(rng.uniform(0.3, 1.0)))

    def stated(self, motion: StatedMotion) -> FloatArray:
        """State where the tool would be without load."""
        stretch = motion.forces * np.array([self.across, self.across, self.along])
        return np.asarray(motion.centres - stretch)


@dataclass(frozen=True)
class CalibrationError(Nuisance):
    """An error that varies smoothly over the workspace, also while landmarks are touched.

    After hand-eye calibration surgical arms are off by some 2 mm over a workspace of 0.2 m.

    Attributes:
        size: RMS error [m].
        length: over which it varies [m].
        seed: of its shape.
    """

    size: float
    length: float
    seed: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 0.3 to 2 mm over 0.2 to 0.3 m."""
        return cls(
            float(rng.uniform(0.3e-3, 2e-3)), float(rng.uniform(0.2, 0.3)), int(rng.integers(2**31))
        )

    def stated(self, motion: StatedMotion) -> FloatArray:
        """Add the error at each place."""
        draw = np.random.default_rng(self.seed)
        waves = draw.normal(size=(WAVES, 3)) * np.pi / (2 * self.length)
        field = sum_of_waves(motion.centres, waves, draw, parts=3) / np.sqrt(WAVES / 2)
        return np.asarray(motion.centres + self.size * field)


@dataclass(frozen=True)
class EncoderSteps(Nuisance):
    """Positions come in steps.

    Attributes:
        step: [m].
    """

    step: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 5 to 50 um."""
        return cls(float(rng.uniform(5e-6, 50e-6)))

    def stated(self, motion: StatedMotion) -> FloatArray:
        """Round each coordinate."""
        return np.asarray(np.round(motion.centres / self.step) * self.step)


@dataclass(frozen=True)
class RobotRate(Nuisance):
    """Poses come at another rate: 50 Hz over a network, 1 kHz from a controller.

    Attributes:
        rate: [1/s].
    """

    rate: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 50 to 1000 Hz, evenly in the logarithm."""
        return cls(float(np.exp(rng.uniform(np.log(50.0), np.log(1000.0)))))

    @property
    def robot_rate(self) -> float | None:
        """The rate."""
        return self.rate
