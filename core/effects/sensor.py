"""Causes in clock and camera: only the observation changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.effects.base import Effect, Slot, parameter
from palpate.foundation.frames import Transform
from palpate.setup.setup import Setup

__all__ = ["CameraRegistration", "DepthBias", "TimeOffset"]


@dataclass(frozen=True, kw_only=True)
class TimeOffset(Effect):
    """Cloud stamp minus robot stamp of the same instant."""

    name, enters = "time_offset", Slot.SENSOR
    summary = "the camera's clock and the robot's differ"
    offset: float = parameter("s", low=-1.0, high=1.0, scale=0.05)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(offset=setup.sensor.time_offset)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(offset=seconds) for seconds in (-0.3, -0.1, 0.1, 0.3)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, sensor=replace(setup.sensor, time_offset=self.offset))


@dataclass(frozen=True, kw_only=True)
class CameraRegistration(Effect):
    """The camera moved after its registration, or was registered wrongly.

    Fitted as a rigid motion about the middle of the block (see `centre`), so that turning and
    shifting stay apart.
    """

    name, enters = "camera_registration", Slot.SENSOR
    summary = "the camera is not where it was registered"
    tx: float = parameter("m", low=-3e-2, high=3e-2, scale=1e-3)
    ty: float = parameter("m", low=-3e-2, high=3e-2, scale=1e-3)
    tz: float = parameter("m", low=-3e-2, high=3e-2, scale=1e-3)
    rx: float = parameter("rad", low=-0.3, high=0.3, scale=1e-2)
    ry: float = parameter("rad", low=-0.3, high=0.3, scale=1e-2)
    rz: float = parameter("rad", low=-0.3, high=0.3, scale=1e-2)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(tx=0.0, ty=0.0, tz=0.0, rx=0.0, ry=0.0, rz=0.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls.neutral(setup)]

    def shift(self, setup: Setup) -> Transform:
        """Stated to true position of a measured point, phantom frame."""
        middle = np.array([0.0, 0.0, setup.stated_geometry.size[2] / 2])
        turn = Transform.from_vector(np.zeros(3), [self.rx, self.ry, self.rz])
        return Transform(
            turn.rotation, middle - turn.rotation @ middle + np.array([self.tx, self.ty, self.tz])
        )

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup,
            sensor=replace(
                setup.sensor, camera_shift=self.shift(setup) @ setup.sensor.camera_shift
            ),
        )

    def reported(self, setup: Setup) -> dict[str, tuple[float | str, str]]:
        """Magnitudes of the motion in the phantom frame first, then the full pose about the block's
        middle.

        The translation is that of the frame's origin, the middle of the base: a turn about the
        block's middle moves it, too.
        """
        shift = self.shift(setup)
        return {
            "translation": (float(np.linalg.norm(shift.translation)), "m"),
            "rotation": (float(np.linalg.norm(shift.rotation_vector)), "rad"),
            **super().reported(setup),
        }


@dataclass(frozen=True, kw_only=True)
class DepthBias(Effect):
    """The camera reads too near or far, or stretches depth: a depth z along its axis is read as
    scale z + offset.

    It read so already when it was registered. A registration makes up for all of it that is a rigid
    motion, which is nearly all of an offset; a scale makes the block look larger or smaller (see
    `palpate.measurement.camera_model`).
    """

    name, enters = "depth_bias", Slot.SENSOR
    summary = "the camera reads too near or far, or stretches depth"
    offset: float = parameter("m", low=-0.05, high=0.05, scale=2e-3, accuracy=3e-3)
    scale: float = parameter("1", low=0.85, high=1.15, scale=5e-3, accuracy=7e-3)

    @classmethod
    def at_rest(cls) -> bool:
        """The cloud of a block at rest is misread like any other."""
        return True

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(offset=setup.sensor.depth_offset, scale=setup.sensor.depth_scale)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(offset=setup.sensor.depth_offset, scale=scale) for scale in (0.97, 1.03)]

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup, sensor=replace(setup.sensor, depth_offset=self.offset, depth_scale=self.scale)
        )
