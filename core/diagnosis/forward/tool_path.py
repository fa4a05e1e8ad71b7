"""Places of the tool in each group under a setup, and their change with other setups.

Both depend on the landmark touches, which register the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup

if TYPE_CHECKING:
    from palpate.diagnosis.forward.jacobian import JacobianRequest

__all__ = ["ToolPath", "tool_path_of"]


@dataclass(frozen=True, eq=False)
class ToolPath:
    """The tool in a sequence's g groups under one setup, and its change with s other setups.

    Attributes:
        correction: from stated to true places, phantom frame.
        centres: (g, 3) of the tool [m].
        moves: (s, g, 3) displacement of the centres by the other setups [m].
        deepest: for each group the deepest place of the tool since the group before it, (3,), and
            its displacement by the other setups, (s, 3) [m]. None where that is the group's own
            place, and where no base slides.
        rotations: (s, 3, 3) rotation of a measured force by the other setups.
        measured: force on the tool (g, 3) and its standard deviation (g,) [N]; None without forces.
    """

    correction: Transform
    centres: FloatArray
    moves: FloatArray
    deepest: list[tuple[FloatArray, FloatArray] | None]
    rotations: FloatArray
    measured: tuple[FloatArray, FloatArray] | None


def tool_path_of(
    data: Observations, setup: Setup, grid: Meshing, request: JacobianRequest | None
) -> ToolPath:
    """Compute the tool's places under a setup and under those of a Jacobian.

    Args:
        data: the sequence.
        setup: of the places.
        grid: the mesh for the sag of the landmarks.
        request: names the other setups; none without it.
    """
    correction = touch_correction(setup, grid)
    centres = correction.apply(data.centres(setup))
    moves = np.zeros((len(request.setups) if request else 0, len(data.groups), 3))
    robot = correction @ setup.phantom_from_robot
    rotations = np.zeros((len(moves), 3, 3))
    for number, other in enumerate(request.setups if request else ()):
        there = touch_correction(other, grid)
        moves[number] = there.apply(data.centres(other)) - centres
        rotations[number] = (there @ other.phantom_from_robot @ robot.inverse()).rotation
    deepest = _deepest(data, setup, grid, request)
    return ToolPath(
        correction,
        centres,
        moves,
        deepest,
        rotations,
        data.force_in_groups(robot, setup.sensor.time_offset),
    )


def _deepest(
    data: Observations, setup: Setup, grid: Meshing, request: JacobianRequest | None
) -> list[tuple[FloatArray, FloatArray] | None]:
    """As `ToolPath.deepest`. A setup's clock shifts the clouds, not the path."""
    if setup.support.friction_coefficient is None or setup.has_history:
        return [None] * len(data.groups)
    chosen, clock = data.deepest_places(setup), setup.sensor.time_offset
    setups = (setup, *(request.setups if request else ()))
    timed = [replace(one, sensor=replace(one.sensor, time_offset=clock)) for one in setups]
    paths = [
        touch_correction(one, grid).apply(data.path(same)[1])
        for one, same in zip(setups, timed, strict=True)
    ]
    places = [
        None if number is None else np.stack([path[number] for path in paths]) for number in chosen
    ]
    return [None if place is None else (place[0], place[1:] - place[0]) for place in places]
