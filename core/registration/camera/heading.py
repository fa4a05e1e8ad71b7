"""Heading of a plain block, decided by the tool's position by camera and by kinematics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.uncertainty import weak_directions
from palpate.setup.phantom_geometry import Geometry

__all__ = ["tool_misfit", "turned_fit"]

ASIDE = 6.0e-3
"""Distance from block and table beyond which points may be the tool's [m]."""
FRAMES = 12
"""Number of frames that are compared."""
FARTHEST = 0.03
"""Limit of the distance of one frame [m]."""


def tool_misfit(
    dataset: Dataset, phantom_from_robot: Transform, headings: list[Transform]
) -> FloatArray:
    """Mean distance (k,) [m] between the tool by the kinematics and by the camera, for each
    phantom_from_camera.

    NaN where no frame shows a tool. Distances are limited to 30 mm.
    """
    distances = [
        _frame_misfits(cloud, centre, dataset.geometry, headings)
        for cloud, centre in _frames(dataset, phantom_from_robot)
    ]
    known = [row for row in distances if np.isfinite(row).all()]
    return np.mean(known, axis=0) if known else np.full(len(headings), np.nan)


def _frames(dataset: Dataset, phantom_from_robot: Transform) -> list[tuple[FloatArray, FloatArray]]:
    """Clouds (n, 3) [m], camera frame, and tool centres (3,) [m], phantom frame, of frames with the
    tool near the block and far from its axis.
    """
    places: list[tuple[float, str, int, FloatArray]] = []
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        if len(sequence) == 0:
            continue
        centres = phantom_from_robot.apply(sequence.kinematics.position_at(sequence.cloud_times))
        aside = np.linalg.norm(centres[:, :2], axis=1)
        near = dataset.geometry.outside(centres) < 0.03
        index = int(np.argmax(np.where(near, aside, -1.0)))
        places.append((float(aside[index]), name, index, centres[index]))
    places.sort(key=lambda place: -place[0])
    return [
        (dataset.sequence(name).cloud(index), centre) for _, name, index, centre in places[:FRAMES]
    ]


def _frame_misfits(
    cloud: FloatArray, centre: FloatArray, geometry: Geometry, headings: list[Transform]
) -> FloatArray:
    found = []
    for heading in headings:
        points = heading.apply(cloud)
        apart = geometry.outside(points)
        tool = points[(apart > ASIDE) & (apart < 0.15) & (points[:, 2] > ASIDE)]
        if len(tool) < 10:
            return np.full(len(headings), np.nan)
        # The tenth nearest point is robust against single stray points.
        nearest = np.partition(np.linalg.norm(tool - centre, axis=1), 9)[9]
        found.append(min(float(nearest), FARTHEST))
    return np.array(found)


def turned_fit(fit: CameraFit) -> CameraFit:
    """The fit with the block turned by half a turn about z; faces and covariance change sides."""
    half = np.diag([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
    swap = {"-x": "+x", "+x": "-x", "-y": "+y", "+y": "-y"}
    covariance = half @ fit.covariance @ half
    counts = {swap.get(face, face): count for face, count in fit.face_counts.items()}
    return replace(
        fit,
        phantom_from_camera=fit.turned,
        covariance=covariance,
        face_counts=counts,
        face_offsets={swap.get(face, face): offset for face, offset in fit.face_offsets.items()},
        weak_directions=weak_directions(covariance, counts, fit.lever),
    )
