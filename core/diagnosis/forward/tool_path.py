"""Where the tool is led under a setup, and how that changes with others: the touches decide
both."""

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
    from palpate.diagnosis.forward.jacobian import Wanted

__all__ = ["ToolPath", "tool_path_of"]


@dataclass(frozen=True, eq=False)
class ToolPath:
    """A sequence's groups under one setup.

    Attributes:
        correction: stated to true phantom_from_robot.
        centres: (g, 3) of the tool [m].
        moves: (s, g, 3) how other setups move them [m].
        turns: of a base that slides, where the tool was deepest since the group before it, a place
            (3,) and how the setups move it (s, 3) [m]; None where that is the group's own place,
            and of what is led along the tool's whole way.
        turned: (s, 3, 3) how the setups turn a measured force.
        measured: force on the tool (g, 3) and its deviation (g,) [N]; None without forces.
    """

    correction: Transform
    centres: FloatArray
    moves: FloatArray
    turns: list[tuple[FloatArray, FloatArray] | None]
    turned: FloatArray
    measured: tuple[FloatArray, FloatArray] | None


def tool_path_of(
    data: Observations, setup: Setup, grid: Meshing, wanted: Wanted | None
) -> ToolPath:
    """Under this setup, and the wanted ones; the grid is for the sag of the landmarks."""
    correction = touch_correction(setup, grid)
    centres = correction.apply(data.centres(setup))
    moves = np.zeros((len(wanted.setups) if wanted else 0, len(data.groups), 3))
    robot = correction @ setup.phantom_from_robot
    turned = np.zeros((len(moves), 3, 3))
    for number, other in enumerate(wanted.setups if wanted else ()):
        there = touch_correction(other, grid)
        moves[number] = there.apply(data.centres(other)) - centres
        turned[number] = (there @ other.phantom_from_robot @ robot.inverse()).rotation
    turns = _turns(data, setup, grid, wanted)
    return ToolPath(
        correction,
        centres,
        moves,
        turns,
        turned,
        data.force_in_groups(robot, setup.sensor.time_offset),
    )


def _turns(
    data: Observations, setup: Setup, grid: Meshing, wanted: Wanted | None
) -> list[tuple[FloatArray, FloatArray] | None]:
    """As `ToolPath.turns`; another clock says when a cloud was taken, not where the tool turned."""
    if setup.support.friction_coefficient is None or setup.has_history:
        return [None] * len(data.groups)
    chosen, clock = data.deepest_places(setup), setup.sensor.time_offset
    setups = (setup, *(wanted.setups if wanted else ()))
    timed = [replace(one, sensor=replace(one.sensor, time_offset=clock)) for one in setups]
    ways = [
        touch_correction(one, grid).apply(data.path(same)[1])
        for one, same in zip(setups, timed, strict=True)
    ]
    places = [
        None if number is None else np.stack([way[number] for way in ways]) for number in chosen
    ]
    return [None if place is None else (place[0], place[1:] - place[0]) for place in places]
