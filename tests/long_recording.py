"""One long bag as the paper's bench records: dVRK 1 poses, organised clouds of another clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from recorded_bags import BagKind, written_bag

from palpate.dataset import Dataset

__all__ = ["CAMERA_BEGAN", "LongRecording", "pixel_grid"]

START = 1_700_000_000 * 10**9
CAMERA_BEGAN = 1_699_995_000 * 10**9
"""Instant from which the camera counts its time [ns]."""
AWAY, PARKED = 0.03, 0.08
"""Distances that the tool keeps between touches, and before it begins [m]."""


@dataclass(frozen=True)
class _Grid:
    """Pixels of the virtual camera: slope = first + pitch number, of columns and rows."""

    first: np.ndarray
    pitch: np.ndarray
    shape: tuple[int, int]

    def image(self, points: np.ndarray) -> np.ndarray:
        """Organised cloud (rows, columns, 3) of points (n, 3), NaN elsewhere."""
        across, down = np.round((points[:, :2] / points[:, 2:] - self.first) / self.pitch).T
        image = np.full((*self.shape, 3), np.nan)
        image[down.astype(int), across.astype(int)] = points
        return image


def pixel_grid(clouds: list[np.ndarray]) -> _Grid:
    """Find the pixels that made clouds of a virtual camera."""
    slopes = np.concatenate([one[:, :2] / one[:, 2:] for one in clouds])
    first, pitch, counts = np.zeros(2), np.zeros(2), [0, 0]
    for axis in range(2):
        values = np.sort(slopes[:, axis])
        steps = np.diff(values)
        steps = steps[steps > 1e-4]
        rough = np.median(steps[steps < 1.5 * steps.min()])
        numbers = np.round((values - values[0]) / rough)
        pitch[axis], first[axis] = np.polyfit(numbers, values, 1)
        counts[axis] = int(numbers.max()) + 1
    return _Grid(first, pitch, (counts[1], counts[0]))


@dataclass(frozen=True)
class LongRecording:
    """Rest, touches of the landmarks in their order, and all sequences of a dataset, in one bag.

    Attributes:
        dataset: that is played.
        rate: of the poses [Hz].
        views: clouds a second while the tool is away from the phantom.
    """

    dataset: Dataset
    rate: float = 100.0
    views: float = 3.0

    def write(self, path: Path, kind: BagKind = "ros1") -> dict[str, float]:
        """Write the bag; returns the time at which each sequence begins [s]."""
        times, poses, begins = self._motion()
        clouds = self._clouds(times[-1], begins)
        grid = pixel_grid([cloud for _, cloud in clouds])
        rng = np.random.default_rng(0)
        events = [(time, 0, at) for at, time in enumerate(times.tolist())]
        events += [(time, 1, at) for at, (time, _) in enumerate(clouds)]
        with written_bag(path, kind) as bag:
            for time, role, at in sorted(events):
                stamp = START + round(time * 1e9)
                if role == 0:
                    received = stamp + int(1e6 * (0.2 + rng.exponential(1.0)))
                    topic = "/dvrk/PSM3/position_cartesian_current"
                    bag.pose(topic, stamp, received, poses[at], "PSM3_base")
                else:
                    received = stamp + int(1e6 * (1.0 + rng.exponential(8.0)))
                    image = grid.image(clouds[at][1])
                    bag.cloud("/camera/points", stamp - CAMERA_BEGAN, received, image, "camera")
        return {name: begin + START / 1e9 for name, begin in begins.items()}

    def _motion(self) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
        """Times (n,) [s], poses (n, 7), and when each sequence begins."""
        first = self.dataset.sequence(self.dataset.sequences[0]).kinematics
        turn = first.quaternion[0]
        up = -_down(self.dataset)
        touched = self.dataset.touches.positions
        parked = touched.mean(axis=0) + PARKED * up
        ends, places = [0.0, 4.0], [parked, parked]
        for place in touched:
            for seconds, goal in ((1.5, place + AWAY * up), (1.0, place), (1.2, place),
                                  (1.0, place + AWAY * up)):  # fmt: skip
                ends.append(ends[-1] + seconds)
                places.append(goal)
        pieces = [_sampled(np.array(ends), np.array(places), turn, self.rate)]
        begins: dict[str, float] = {}
        now = ends[-1]
        for name in self.dataset.sequences:
            played = self.dataset.sequence(name).kinematics
            last = pieces[-1][1][-1, :3]
            way = np.array([last, parked, played.position[0]])
            pieces.append(_sampled(now + np.array([0.0, 1.5, 3.0]), way, turn, self.rate))
            now += 3.0
            begins[name] = now
            every = max(1, round(1 / (self.rate * np.median(np.diff(played.time)))))
            path = np.concatenate([played.position, played.quaternion], axis=1)[::every]
            elapsed = (played.time - played.time[0])[::every]
            pieces.append((now + elapsed, path))
            now += elapsed[-1] + 1 / self.rate
        times = np.concatenate([one for one, _ in pieces])
        poses = np.concatenate([one for _, one in pieces])
        kept = np.concatenate([[True], np.diff(times) > 1e-4])
        return times[kept], poses[kept], begins

    def _clouds(self, end: float, begins: dict[str, float]) -> list[tuple[float, np.ndarray]]:
        """Time and points of each view; the untouched phantom wherever no sequence plays."""
        rest = self.dataset.rest_cloud()
        seen: list[tuple[float, np.ndarray]] = []
        spans = []
        for name, begin in begins.items():
            sequence = self.dataset.sequence(name)
            origin = sequence.kinematics.time[0]
            spans.append((begin, begin + sequence.kinematics.time[-1] - origin))
            seen += [
                (begin + time - origin, sequence.cloud(at))
                for at, time in enumerate(sequence.cloud_times)
            ]
        for time in np.arange(0.1, end, 1 / self.views).tolist():
            if not any(low - 0.2 < time < high + 0.2 for low, high in spans):
                seen.append((time, rest))
        return sorted(seen, key=lambda one: one[0])


def _sampled(
    ends: np.ndarray, places: np.ndarray, turn: np.ndarray, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(ends[0], ends[-1], 1 / rate)
    path = np.stack([np.interp(times, ends, places[:, axis]) for axis in range(3)], axis=-1)
    return times, np.concatenate([path, np.tile(turn, (len(times), 1))], axis=1)


def _down(dataset: Dataset) -> np.ndarray:
    """Direction from the top into the phantom (3,), robot frame."""
    from palpate.registration.registration import register

    return register(dataset).phantom_from_robot.inverse().rotation @ np.array([0.0, 0.0, -1.0])
