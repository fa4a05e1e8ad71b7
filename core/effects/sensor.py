"""Causes in clock and camera, which change the observation only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from palpate.effects.base import MEASURE_SIZE, Effect, Slot
from palpate.effects.family import CAMERA
from palpate.effects.linearisation import Linearisation, NuisanceBlock
from palpate.effects.parameter import parameter
from palpate.foundation.frames import Transform
from palpate.foundation.quantities import quantity
from palpate.setup.setup import Setup

__all__ = ["CameraRegistration", "DepthBias", "TimeOffset", "with_moved_camera"]


def with_moved_camera(setup: Setup, motion: Sequence[float]) -> Setup:
    """Return the setup with a camera that has moved since its registration.

    Args:
        setup: of the camera as registered.
        motion: translation [m] and rotation vector [rad] about the middle of the block (6,).
    """
    shift = _camera_shift(setup, motion) @ setup.sensor.camera_shift
    return replace(setup, sensor=replace(setup.sensor, camera_shift=shift))


def _camera_shift(setup: Setup, motion: Sequence[float]) -> Transform:
    middle = np.array([0.0, 0.0, setup.stated_geometry.size[2] / 2])
    turn = Transform.from_vector(np.zeros(3), list(motion[3:]))
    return Transform(turn.rotation, middle - turn.rotation @ middle + np.array(motion[:3]))


@dataclass(frozen=True, kw_only=True)
class TimeOffset(Effect):
    """Cloud stamp minus robot stamp of the same instant."""

    name, enters = "time_offset", Slot.SENSOR
    summary = "the camera's clock and the robot's differ"
    linearisation = Linearisation.TANGENT
    offset: float = parameter("s", low=-1.0, high=1.0, scale=0.05, accuracy=2.2e-3)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(offset=setup.sensor.time_offset)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(offset=seconds) for seconds in (-0.3, -0.1, 0.1, 0.3)]

    def initial_guess(self, changes: Mapping[str, float]) -> Self:
        """Return the effect itself: the linear fit holds for a fraction of a frame's duration."""
        return self

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, sensor=replace(setup.sensor, time_offset=self.offset))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        early = "late" if values["offset"] > 0 else "early"
        return f"that the camera's clock runs {quantity(abs(values['offset']), 's')} {early}"


@dataclass(frozen=True, kw_only=True)
class CameraRegistration(Effect):
    """The camera moved after its registration, or was registered wrongly.

    It is fitted as a rigid motion about the middle of the block, so that rotation and translation
    stay apart.
    """

    name, enters = "camera_registration", Slot.SENSOR
    family = CAMERA
    summary = "the camera is not where it was registered"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.CAMERA_POSE
    tx: float = parameter("m", low=-3e-2, high=3e-2, scale=1e-3, accuracy=2e-4)
    ty: float = parameter("m", low=-3e-2, high=3e-2, scale=1e-3, accuracy=2e-4)
    tz: float = parameter("m", low=-3e-2, high=3e-2, scale=1e-3, accuracy=2e-4)
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
        """Return the stated to true position of a measured point, phantom frame."""
        return _camera_shift(setup, self.coordinates)

    def apply(self, setup: Setup) -> Setup:
        return with_moved_camera(setup, self.coordinates)

    def reported(self, setup: Setup) -> dict[str, tuple[float | str, str]]:
        """Return the magnitudes of the motion first, then the pose about the block's middle.

        The translation is that of the phantom frame's origin, the middle of the base, which a
        rotation about the block's middle moves too.
        """
        shift = self.shift(setup)
        return {
            "translation": (float(np.linalg.norm(shift.translation)), "m"),
            "rotation": (float(np.linalg.norm(shift.rotation_vector)), "rad"),
            **super().reported(setup),
        }

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        turn = f" and {quantity(values['rotation'], 'rad')}" if values.get("rotation") else ""
        moved = quantity(values["translation"], "m")
        return f"that the camera stands {moved}{turn} off its registration"


@dataclass(frozen=True, kw_only=True)
class DepthBias(Effect):
    """The camera reads a depth z along its axis as scale z + offset.

    The bias was there when the camera was registered. The registration compensates the part of it
    that is a rigid motion, which is nearly all of an offset; a scale makes the block look larger or
    smaller (see `palpate.measurement.camera_model`).
    """

    name, enters = "depth_bias", Slot.SENSOR
    family = CAMERA
    summary = "the camera reads too near or far, or stretches depth"
    linearisation, joint = Linearisation.TANGENT, True
    told_apart_by = MappingProxyType(
        {
            "geometry_scale": MEASURE_SIZE,
            "camera_registration": "record the untouched phantom from nearer and from farther away",
        }
    )
    offset: float = parameter("m", low=-0.05, high=0.05, scale=2e-3, accuracy=3e-3)
    scale: float = parameter("1", low=0.85, high=1.15, scale=5e-3, accuracy=7e-3)

    @classmethod
    def at_rest(cls) -> bool:
        """Return True: the rest cloud is misread like any other."""
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

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        offset, scale = quantity(values["offset"], "m"), values["scale"]
        return f"a camera that misreads depth, by {offset} and {scale:.3g} times"
