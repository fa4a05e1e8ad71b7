"""Contacts of a tool path with the stated phantom: pushes and drags with depth, place and speed.

The stated phantom is rigid here, so a depth is the overlap of the sphere with the phantom at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from palpate.dataset.folder import Dataset
from palpate.dataset.sequence import Sequence
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.setup.setup import Box, Shape

__all__ = [
    "Contact",
    "ContactKind",
    "ToolMotion",
    "averaged_path",
    "describe_motion",
    "find_contacts",
    "smooth_path",
]

ContactKind = Literal["top", "side", "drag"]

TOUCHING = 0.0005
"""Gap below which the tool counts as touching [m], about the accuracy of touches."""
RELEASED = 0.001
"""Gap that separates two contacts [m]."""
_LEVEL = 0.7
"""Vertical part of a normal below which a surface is a side [1]."""
_STEP = 0.05
"""Time over which positions are averaged [s], so that noise does not count as speed."""


@dataclass(frozen=True, kw_only=True)
class Contact:
    """One contact from touch to release.

    Attributes:
        kind: "top" and "side" are pushes into that face, "drag" travels along it.
        start: on the robot's clock [s].
        end: on the robot's clock [s].
        depth: largest overlap of the sphere with the phantom at rest [m].
        place: tool centre at first touch [m], phantom frame.
        travel: distance along the touched face [m].
        speed: upper quartile of the speed [m/s].
    """

    kind: ContactKind
    start: float
    end: float
    depth: float
    place: tuple[float, float, float]
    travel: float
    speed: float


@dataclass(frozen=True, kw_only=True)
class ToolMotion:
    """Contacts of one sequence.

    Attributes:
        contacts: in order of time.
        nearest: smallest gap between sphere and phantom at rest [m]; negative where they overlap.
        untouched_before: number of clouds before the first contact.
        untouched_after: number of clouds after the last contact.
        rest_after: time from the last contact to the last cloud, or to the last row of kinematics
            without clouds [s].
    """

    contacts: tuple[Contact, ...]
    nearest: float
    untouched_before: int
    untouched_after: int
    rest_after: float

    def has(self, kind: ContactKind) -> bool:
        """Whether any contact is of this kind."""
        return any(contact.kind == kind for contact in self.contacts)


def describe_motion(
    dataset: Dataset, sequence: Sequence, phantom_from_robot: Transform
) -> ToolMotion:
    """Find the contacts of a sequence by the stated geometry and radius and a registration."""
    time, path = smooth_path(sequence, phantom_from_robot)
    contacts, gap = find_contacts(dataset.geometry, dataset.config.tool_radius, time, path)
    last_seen = float(sequence.cloud_times[-1] if len(sequence) else time[-1])
    return ToolMotion(
        contacts=contacts,
        nearest=float(gap.min()),
        untouched_before=int((sequence.cloud_times < contacts[0].start).sum())
        if contacts
        else len(sequence),
        untouched_after=int((sequence.cloud_times > contacts[-1].end).sum()) if contacts else 0,
        rest_after=max(0.0, last_seen - contacts[-1].end) if contacts else 0.0,
    )


def find_contacts(
    geometry: Box | Shape, radius: float, time: FloatArray, path: FloatArray
) -> tuple[tuple[Contact, ...], FloatArray]:
    """Find the contacts of a ball with a phantom at rest.

    Args:
        geometry: of the phantom.
        radius: of the ball [m].
        time: (n,) [s].
        path: (n, 3) centres of the ball [m], phantom frame.

    Returns:
        the contacts in order of time, and the gaps (n,) [m] between ball and phantom.
    """
    distance, normals = geometry.facing(path)
    gap = distance - radius
    contacts = tuple(
        _contact(time[part], path[part], gap[part], normals[part.start]) for part in _episodes(gap)
    )
    return contacts, gap


def smooth_path(sequence: Sequence, phantom_from_robot: Transform) -> tuple[FloatArray, FloatArray]:
    """Times (n,) [s] and tool centres (n, 3) [m], phantom frame, averaged over short steps."""
    kinematics = sequence.kinematics
    return averaged_path(kinematics.time, phantom_from_robot.apply(kinematics.position))


def averaged_path(time: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Average times (n,) [s] and points (n, 3) [m] over steps of 0.05 s."""
    _, index, counts = np.unique(
        np.floor((time - time[0]) / _STEP), return_inverse=True, return_counts=True
    )
    means = [np.bincount(index, weights=column) / counts for column in (time, *points.T)]
    return means[0], np.stack(means[1:], axis=-1)


def _episodes(gap: FloatArray) -> list[slice]:
    """Rows of each contact: runs of touching rows, joined unless the tool leaves in between."""
    touching = np.flatnonzero(gap < TOUCHING)
    runs: list[slice] = []
    for at in map(int, touching):
        if runs and gap[runs[-1].stop : at + 1].max() < RELEASED:
            runs[-1] = slice(runs[-1].start, at + 1)
        else:
            runs.append(slice(at, at + 1))
    return runs


def _contact(time: FloatArray, path: FloatArray, gap: FloatArray, normal: FloatArray) -> Contact:
    along = path - (path @ normal)[:, None] * normal
    travel, depth = float(np.linalg.norm(np.ptp(along, axis=0))), -float(gap.min())
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1) / np.diff(time)
    kind: ContactKind = "top" if normal[2] > _LEVEL else "side"
    x, y, z = (float(value) for value in path[0])
    return Contact(
        # A slanted push travels by about its own depth, a drag by several times that.
        kind="drag" if travel > max(2 * depth, 0.005) else kind,
        start=float(time[0]),
        end=float(time[-1]),
        depth=depth,
        place=(x, y, z),
        travel=travel,
        speed=float(np.percentile(steps, 75)) if len(steps) else 0.0,
    )
