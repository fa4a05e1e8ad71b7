"""Ways in which a bench relates its robot to the phantom: touches, traces, or calibrated poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.bodies.surface_traces import draw_traces
from palpate.synthetic.dataset_writer import Calibration, write_touches, write_traces

__all__ = ["ROBOT_RELATIONS", "Bench"]

_MATRIX = 5e-4, 2e-3
"""Accuracy of a careful calibration of the robot on the phantom [m, rad]."""
_HAND_EYE = 7e-4, 3e-3
"""Accuracy of a good hand-eye calibration [m, rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """The phantom, the robot and the camera as they stand.

    Attributes:
        body: the true body, as it lies.
        radius: true radius of the ball [m].
        marks: names of the landmarks.
        touched: (n, 3) tool centres at the landmarks [m], phantom frame.
        robot_from_phantom: true.
        phantom_from_camera: true.
    """

    body: Shape
    radius: float
    marks: tuple[str, ...]
    touched: FloatArray
    robot_from_phantom: Transform
    phantom_from_camera: Transform


Relate = Callable[[Bench, Path, np.random.Generator], Mapping[str, Calibration]]


def _touches(bench: Bench, folder: Path, random: np.random.Generator) -> Mapping[str, Calibration]:
    """Write touches of the landmarks."""
    places = bench.robot_from_phantom.apply(bench.touched)
    write_touches(folder / "touches.csv", list(bench.marks), places)
    return {}


def _traces(bench: Bench, folder: Path, random: np.random.Generator) -> Mapping[str, Calibration]:
    """Write traces over the surface."""
    strokes, centres = draw_traces(bench.body, bench.radius, random)
    write_traces(folder / "traces.csv", strokes, bench.robot_from_phantom.apply(centres))
    return {}


def _matrix(bench: Bench, folder: Path, random: np.random.Generator) -> Mapping[str, Calibration]:
    """State the pose of the robot."""
    true = bench.robot_from_phantom.inverse()
    return {"phantom_from_robot": _calibrated(true, *_MATRIX, random)}


def _hand_eye(bench: Bench, folder: Path, random: np.random.Generator) -> Mapping[str, Calibration]:
    """State the pose of the camera on the robot."""
    true = bench.robot_from_phantom @ bench.phantom_from_camera
    return {"robot_from_camera": _calibrated(true, *_HAND_EYE, random)}


def _calibrated(
    true: Transform, position: float, rotation: float, random: np.random.Generator
) -> Calibration:
    """A pose with an error of these standard deviations [m, rad]."""
    error = Transform.from_vector(np.zeros(3), rotation * random.normal(size=3))
    pose = Transform(
        error.rotation @ true.rotation, true.translation + position * random.normal(size=3)
    )
    return Calibration(pose, position, rotation)


ROBOT_RELATIONS: Mapping[str, Relate] = MappingProxyType(
    {"touches": _touches, "traces": _traces, "matrix": _matrix, "hand-eye": _hand_eye}
)
"""Each way by its name: it writes its file, if it has one, and returns the poses to state."""
