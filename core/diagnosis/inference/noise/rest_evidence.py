"""Data without a push: the rest cloud, and the touches from which the robot was registered.

A registration fits the touches to their landmarks by a rigid motion. The residuals that remain
carry no information on the pose; they test the size and the order of the touched polygon. Only they
tell touches of other places from a robot that is registered wrongly, or from a tool offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.noise.rest_cloud import RestCloud
from palpate.foundation.arrays import FloatArray
from palpate.measurement.touch_correction import touch_misses, touched_places
from palpate.mesh.protocol import Meshing
from palpate.registration.pose import motion_jacobian
from palpate.setup.setup import Setup

__all__ = ["RestEvidence", "touch_block", "touch_deviation"]


Varied = dict[int, tuple[Setup, float]]
"""Column to (setup a little changed, step)."""


@dataclass(frozen=True, eq=False)
class RestEvidence:
    """All data without a push, as one block.

    Attributes:
        cloud: the rest cloud.
    """

    cloud: RestCloud

    def block(
        self, stated: Setup, setup: Setup, grid: Meshing, columns: int, varied: Varied
    ) -> Block:
        """Return the quadratic form of cloud and touches; arguments as for `RestCloud.block`."""
        cloud, touches = (
            self.cloud.block(stated, setup, grid, columns, varied),
            touch_block(setup, grid, columns, varied),
        )
        return Block(cloud.name, cloud.gram + touches.gram, cloud.values + touches.values)


def touch_block(setup: Setup, grid: Meshing, columns: int, varied: Varied) -> Block:
    """Return the quadratic form of the touches' residuals, with the robot's pose integrated out.

    The prior of the pose is flat. Fewer than three touches register nothing, and have no block of
    data.

    Args:
        setup: of the model.
        grid: mesh for the sag of the landmarks.
        columns: total number of columns.
        varied: as for `RestCloud.block`.
    """
    count = len(setup.landmarks)
    if count < CRITERIA.rest.least_touches:
        return Block("touches", np.zeros((1 + columns, 1 + columns)), 0.0)
    here = touch_misses(setup, grid)
    stacked = np.zeros((3 * count, 1 + columns))
    stacked[:, 0] = here.ravel()
    for column, (other, step) in varied.items():
        stacked[:, 1 + column] = (touch_misses(other, grid) - here).ravel() / step
    stacked = _beside_pose(touched_places(setup), stacked) / touch_deviation(setup)
    return Block("touches", stacked.T @ stacked, 3.0 * count - 6.0)


def touch_deviation(setup: Setup) -> float:
    """Standard deviation of one coordinate of a touch [m]: of the dataset, or the usual one."""
    return setup.touching.deviation or CRITERIA.rest.touch_deviation


def _beside_pose(places: FloatArray, rows: FloatArray) -> FloatArray:
    """Return rows (3n, k) without the part that a small rigid motion of the places (n, 3) [m]
    explains.
    """
    middle = places.mean(axis=0)
    reach = float(np.sqrt(((places - middle) ** 2).sum(axis=1).mean()))
    motions = motion_jacobian(places, middle).reshape(-1, 6) * np.repeat([1.0, 1.0 / reach], 3)
    basis, _ = np.linalg.qr(motions)
    return np.asarray(rows - basis @ (basis.T @ rows))
