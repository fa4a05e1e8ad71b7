"""The tool as the clouds of a sequence show it, beside where the kinematics put it.

The shaft is found in each cloud by itself, without the quaternions: the line through what stands
clear of phantom and table. Its lower end is compared with the end that would be seen of the tool
by the kinematics, so that a tip hidden near the surface is no difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.consistency.contact_timeline import ContactTimeline
from palpate.dataset import Dataset, Sequence
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.registration.registration import Registration

__all__ = ["SeenTool", "seen_tools"]

_FRAMES = 28
"""Largest number of clouds of a sequence that are read."""
_MOST_POINTS = 20_000
"""Points of a cloud that are looked at."""
_CLEAR = 6e-3
"""Distance from phantom and table from which points may be the tool's [m]."""
_REACH = 0.12
"""Distance from the phantom up to which they may [m]."""
_ASIDE = 10e-3
"""Distance from the line through the shaft up to which points are its own [m]."""
_FEWEST = 25
"""Least points that show a shaft."""
_SLENDER, _THICKEST = 1.6, 5e-3
"""Least length of what is seen over its width [1], and largest standard deviation across it [m]."""
_END = 2
"""Lowest points that may be stray."""
_CELL, _STILL = 4e-3, 0.6
"""Edge of the cells in which points are counted [m], and share of all frames that fill a cell from
which it holds a thing that stands still [1]."""
_LENGTH, _STEP = 0.10, 1e-3
"""Length of the shaft [m] along which its seen end is looked for, and the step."""
_FRONT = 0.7
"""How far the seen front of a rod lies before its axis, over its radius [1]."""


@dataclass(frozen=True, eq=False)
class SeenTool:
    """The seen tool of a sequence; rows of frames that show none are left out.

    Attributes:
        name: of the sequence.
        frames: number of clouds that were looked at.
        time: (m,) stamps [s].
        end: (m, 3) lower end of the seen shaft [m], phantom frame.
        axis: (m, 3) unit vectors along the shaft, away from the tip, phantom frame.
        clock: (n,) [s] of the kinematics.
        expected: (n, 3) where that end should be by the kinematics [m].
    """

    name: str
    frames: int
    time: FloatArray
    end: FloatArray
    axis: FloatArray
    clock: FloatArray
    expected: FloatArray

    def apart(self, late: float = 0.0, rate: float = 0.0) -> FloatArray:
        """Vectors (m, 3) [m] from the expected to the seen ends.

        Args:
            late: by which the camera's stamps are late [s].
            rate: by which its clock is fast [1].
        """
        middle = 0.5 * (self.clock[0] + self.clock[-1])
        at = self.time - late - rate * (self.time - middle)
        columns = [np.interp(at, self.clock, column) for column in self.expected.T]
        return np.asarray(self.end - np.stack(columns, axis=-1))

    @property
    def spread(self) -> float:
        """Largest angle between the seen axes and their mean [rad], strays left out."""
        if len(self.axis) < 3:
            return 0.0
        mean = self.axis.mean(axis=0)
        angles = np.arccos(np.clip(self.axis @ mean / np.linalg.norm(mean), -1.0, 1.0))
        return float(np.quantile(angles, 0.9))


def seen_tools(dataset: Dataset, registration: Registration) -> list[SeenTool]:
    """Look for the tool in some clouds of every sequence that has clouds.

    Cells that most frames of all sequences fill, or the rest cloud does, hold no tool.
    """
    pose = registration.phantom_from_camera
    frames: dict[str, list[tuple[float, FloatArray]]] = {}
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        count = len(sequence)
        rows = np.linspace(0, count - 1, min(count, _FRAMES)).round().astype(int)
        if count:
            frames[name] = [
                (
                    float(sequence.cloud_times[row]),
                    _clear(dataset, pose.apply(_thinned(sequence.cloud(int(row))))),
                )
                for row in np.unique(rows)
            ]
    rest = pose.apply(_thinned(dataset.rest_cloud())) if dataset.has_rest else np.zeros((0, 3))
    still = _still_cells([points for one in frames.values() for _, points in one], len(frames))
    still = np.union1d(still, _cells(_clear(dataset, rest)))
    return [
        _seen(
            dataset,
            dataset.sequence(name),
            registration,
            [(time, points[~np.isin(_cells(points), still)]) for time, points in own],
        )
        for name, own in frames.items()
    ]


def _seen(
    dataset: Dataset,
    sequence: Sequence,
    registration: Registration,
    frames: list[tuple[float, FloatArray]],
) -> SeenTool:
    """The tool of a sequence in frames of stamps [s] and points (k, 3) [m] that may be its own."""
    shafts = [(time, _shaft(points, dataset)) for time, points in frames]
    found = [(time, *shaft) for time, shaft in shafts if shaft is not None]
    end, axis = (np.array([one[part] for one in found]).reshape(-1, 3) for part in (1, 2))
    timeline = ContactTimeline.of(dataset, sequence, registration.repaired.phantom_from_robot)
    mean = axis.sum(axis=0) if len(axis) else np.array([0.0, 0.0, 1.0])
    mean = mean / max(float(np.linalg.norm(mean)), 1e-9)
    camera = registration.phantom_from_camera.translation
    return SeenTool(
        sequence.name,
        len(frames),
        np.array([one[0] for one in found]),
        end,
        axis,
        timeline.time,
        _ends(dataset, timeline.centre, mean, camera),
    )


def _thinned(cloud: FloatArray) -> FloatArray:
    return np.asarray(cloud[:: len(cloud) // _MOST_POINTS + 1])


def _cells(points: FloatArray) -> IntArray:
    """Number (n,) of the cell of each point (n, 3) [m] within a metre of the origin."""
    places = np.clip(np.floor(points / _CELL).astype(np.int64) + 512, 0, 1023)
    return np.asarray((places[:, 0] * 1024 + places[:, 1]) * 1024 + places[:, 2])


def _still_cells(frames: list[FloatArray], sequences: int) -> IntArray:
    """Cells that most frames fill; none from one sequence, whose shaft may stay in its place."""
    if sequences < 2:
        return np.zeros(0, np.int64)
    cells, counts = np.unique(
        np.concatenate([np.unique(_cells(points)) for points in frames]), return_counts=True
    )
    return np.asarray(cells[counts > _STILL * len(frames)])


def _clear(dataset: Dataset, points: FloatArray) -> FloatArray:
    """Points (k, 3) of (n, 3) [m], phantom frame, that stand clear of phantom and table."""
    high = points[points[:, 2] > _CLEAR]
    apart = dataset.geometry.outside(high)
    return np.asarray(high[(apart > _CLEAR) & (apart < _REACH)])


def _shaft(points: FloatArray, dataset: Dataset) -> tuple[FloatArray, FloatArray] | None:
    """Lower end (3,) [m] and axis (3,) of the rod that points (n, 3) show; None for no rod."""
    if len(points) < _FEWEST:
        return None
    middle, axis = np.median(points, axis=0), np.zeros(3)
    own = points[np.linalg.norm(points - middle, axis=1) < _REACH / 2]
    for _ in range(4):
        if len(own) < _FEWEST:
            return None
        middle = own.mean(axis=0)
        values, vectors = np.linalg.eigh(np.cov((own - middle).T))
        axis = vectors[:, 2]
        offset = points - middle
        along = offset @ axis
        across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
        own = points[across < _ASIDE]
    length, width = np.sqrt(np.maximum(values[[2, 1]], 1e-12))
    if len(own) < _FEWEST or length < _SLENDER * width or width > _THICKEST:
        return None
    low, high = dataset.geometry.low, dataset.geometry.high
    if axis @ (middle - 0.5 * (low + high)) < 0:
        axis = -axis
    along = (own - middle) @ axis
    end = float(np.partition(along, min(_END, len(along) - 1))[min(_END, len(along) - 1)])
    return middle + end * axis, axis


def _ends(
    dataset: Dataset, centres: FloatArray, axis: FloatArray, camera: FloatArray
) -> FloatArray:
    """Ends (n, 3) [m] that would be seen of tools whose centres (n, 3) [m] are given."""
    radius = dataset.config.tool_radius
    heights = np.arange(-radius, _LENGTH, _STEP)
    places = centres[:, None, :] + heights[:, None] * axis
    clear = (places[..., 2] > _CLEAR).ravel()
    apart = np.zeros(clear.size)
    apart[clear] = dataset.geometry.outside(places.reshape(-1, 3)[clear])
    seen = (apart > _CLEAR).reshape(places.shape[:2])
    first = np.where(seen.any(axis=1), heights[seen.argmax(axis=1)], np.nan)
    sight = centres - camera
    sight = sight - (sight @ axis)[:, None] * axis
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-9)
    ends = centres + first[:, None] * axis - _FRONT * radius * sight
    return np.asarray(ends)
