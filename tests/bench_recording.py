"""One long recording of a bench: four touched corners, pushes from above and the side, a drag."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image
from recorded_bags import BagKind, WrittenBag, written_bag
from scipy.spatial.transform import Rotation
from small_dataset import SIZE, TOML

__all__ = ["CORNERS", "ROBOT_FROM_PHANTOM", "BenchRecording", "SeenAs", "bench_setup"]

SeenAs = Literal["points", "32FC1", "16UC1", "compressed"]
"""How the camera's views are recorded."""
MATRIX = np.array([[100.0, 0.0, 15.0], [0.0, 100.0, 10.0], [0.0, 0.0, 1.0]])
"""Intrinsics of the camera [pixels]."""
RADIUS = 0.005
START = 1_700_000_000 * 10**9
_SIGNS = ((1, 1), (1, -1), (-1, -1), (-1, 1))
CORNERS = np.array([[x * SIZE[0] / 2, y * SIZE[1] / 2, SIZE[2]] for x, y in _SIGNS])
ROBOT_FROM_PHANTOM = (Rotation.from_euler("xyz", [0.3, -0.2, 0.9]), np.array([0.12, -0.05, 0.20]))
TOP = SIZE[2] + RADIUS
SIDE = SIZE[0] / 2 + RADIUS


def bench_setup(folder: Path) -> Path:
    """A dataset.toml without splits."""
    path = folder / "dataset.toml"
    path.write_text(TOML.split("[splits]")[0])
    return path


def _waypoints() -> list[tuple[float, list[float]]]:
    """Times to the next point [s] and points [m], phantom frame: touches, then five motions."""
    path: list[tuple[float, list[float]]] = [(2.0, [0, 0, 0.08])]
    for x, y, z in CORNERS.tolist():
        path += [
            (1.5, [x, y, z + 0.02]),
            (1.0, [x, y, z]),
            (1.2, [x, y, z]),
            (1.0, [x, y, z + 0.02]),
        ]
    clear = TOP + 0.02
    for x in (0.0, 0.01):
        path += [(2.0, [x, 0, clear]), (2.0, [x, 0, TOP - 0.006]), (2.0, [x, 0, clear])]
    path += [(1.5, [SIDE + 0.03, 0, TOP + 0.02]), (1.5, [SIDE + 0.03, 0, 0.02])]
    path += [(2.0, [SIDE - 0.005, 0, 0.02]), (2.0, [SIDE + 0.03, 0, 0.02])]
    path += [(1.5, [SIDE + 0.03, 0, TOP + 0.02]), (2.0, [-0.015, 0, clear])]
    path += [
        (1.5, [-0.015, 0, TOP - 0.002]),
        (3.0, [0.015, 0, TOP - 0.002]),
        (1.5, [0.015, 0, clear]),
    ]
    path += [(6.0, [0.015, 0, clear])]
    return path


@dataclass
class BenchRecording:
    """The motion, and what the sensors of the bench say of it.

    Attributes:
        rate: of the poses [Hz].
        zero: of the force sensor [N].
        weight: of what hangs on it [N], along the robot's -z.
    """

    rate: float = 100.0
    zero: tuple[float, float, float] = (0.3, -0.2, 0.5)
    weight: float = 0.8

    def motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Stamps [ns], tool centres [m] in both frames (phantom, robot), orientations xyzw."""
        steps = _waypoints()
        ends = np.cumsum([duration for duration, _ in steps])
        times = np.arange(0, ends[-1], 1 / self.rate)
        places = np.array([point for _, point in steps])
        phantom = np.stack([np.interp(times, ends, places[:, axis]) for axis in range(3)], axis=-1)
        rotation, shift = ROBOT_FROM_PHANTOM
        turns = Rotation.from_euler("xy", np.stack([0.5 * np.sin(times), 0.4 * np.cos(times)], -1))
        stamps = START + np.round(times * 1e9).astype(np.int64)
        return stamps, phantom, rotation.apply(phantom) + shift, turns.as_quat()

    def felt(self) -> np.ndarray:
        """True force on the tool (n, 3) [N], robot frame: 100 N/m of depth under the top."""
        _, phantom, _, _ = self.motion()
        above = np.abs(phantom[:, 0]) < SIZE[0] / 2 - 0.001
        depth = np.where(above, np.maximum(0, TOP - phantom[:, 2]), 0)
        depth[self.motion()[0] < START + 20 * 10**9] = 0
        return np.asarray(ROBOT_FROM_PHANTOM[0].apply(depth[:, None] * [0, 0, 100.0]))

    def sensed(self) -> np.ndarray:
        """Forces of the sensor (n, 3) [N] in the tool's axes, with weight and zero."""
        turns = Rotation.from_quat(self.motion()[3])
        return np.asarray(
            turns.inv().apply(self.felt() + np.array([0, 0, -self.weight])) + np.array(self.zero)
        )

    def image(self, number: int) -> np.ndarray:
        """An organised cloud (rows, columns, 3) [m], camera frame, with 1 mm of noise."""
        rng = np.random.default_rng(number)
        rows, columns = np.mgrid[:20, :30]
        depth = 0.4 + rng.normal(0, 0.001, rows.shape)
        across, down = (columns - MATRIX[0, 2]) / MATRIX[0, 0], (rows - MATRIX[1, 2]) / MATRIX[1, 1]
        points = np.stack([across * depth, down * depth, depth], axis=-1)
        points[rng.random(rows.shape) < 0.1] = np.nan
        return points

    def write(
        self, path: Path, kind: BagKind = "ros1", clouds: bool = True, seen_as: SeenAs = "points"
    ) -> Path:
        """Write the recording as one bag; clouds, or depth images, at 5 Hz."""
        stamps, _, places, turns = self.motion()
        forces = self.sensed()
        every = round(self.rate / 5)
        with written_bag(path, kind) as bag:
            for at, stamp in enumerate(stamps.tolist()):
                pose = np.concatenate([places[at], turns[at]])
                bag.pose("/PSM1/measured_cp", stamp, stamp + 2_000_000, pose, "PSM1_base")
                bag.wrench("/ati", stamp, stamp + 2_000_000, forces[at], "ati_link")
                if clouds and at % every == 0:
                    _write_view(bag, stamp, self.image(at), seen_as)
        return path


def _write_view(bag: WrittenBag, stamp: int, points: np.ndarray, seen_as: SeenAs) -> None:
    received = stamp + 9_000_000
    if seen_as == "points":
        bag.cloud("/camera/points", stamp, received, points, "camera")
        return
    depth = np.nan_to_num(points[..., 2])
    levels = np.round(1000 * depth).astype(np.uint16)
    bag.camera_info("/camera/camera_info", stamp, received, depth.shape, MATRIX, np.zeros(5))
    if seen_as == "compressed":
        stream = io.BytesIO()
        Image.fromarray(levels).save(stream, format="PNG")
        data = b"\0" * 12 + stream.getvalue()
        bag.compressed("/camera/packed", stamp, received, data, "16UC1; compressedDepth png")
        return
    image = levels if seen_as == "16UC1" else depth.astype(np.float32)
    bag.image("/camera/image", stamp, received, image, "camera")
