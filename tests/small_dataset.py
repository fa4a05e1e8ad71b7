"""A small valid dataset, written by hand and in milliseconds, for tests that read or break one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

__all__ = ["SIZE", "ply_bytes", "small_cloud", "write_valid_dataset"]

SIZE = (0.0687, 0.0393, 0.0358)
_ROBOT_FROM_PHANTOM = (Rotation.from_euler("xyz", [0.3, -0.2, 0.9]), np.array([0.12, -0.05, 0.20]))
_CAMERA_FROM_PHANTOM = (Rotation.from_euler("xyz", [2.5, 0.1, 0.2]), np.array([0.01, 0.02, 0.35]))

TOML = """\
format = 1
name = "small-block"

[phantom]
geometry = "box"
size = [0.0687, 0.0393, 0.0358]
mass = 0.10401
fixed = "base"

[tool]
shape = "sphere"
radius = 0.005

[landmarks]
corner_0 = [0.03435, 0.01965, 0.0358]
corner_1 = [0.03435, -0.01965, 0.0358]
corner_2 = [-0.03435, -0.01965, 0.0358]
corner_3 = [-0.03435, 0.01965, 0.0358]
touch_offset = 0.0

[camera]
name = "test camera"
depth_sigma = 0.002

[splits]
train = ["poke-01"]
validation = []
test = ["drag-01"]
"""


def ply_bytes(points: np.ndarray) -> bytes:
    """A binary PLY of points (n, 3) [m]."""
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    return (
        header + "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    ).encode() + points.astype("<f4").tobytes()


def write_valid_dataset(folder: Path) -> Path:
    """Write a dataset of two sequences, five clouds each, one of them with forces; returns the
    folder.
    """
    rotation, shift = _ROBOT_FROM_PHANTOM
    corners = np.array(
        [
            [x * SIZE[0] / 2, y * SIZE[1] / 2, SIZE[2]]
            for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
        ]
    )
    folder.mkdir(parents=True)
    (folder / "dataset.toml").write_text(TOML)
    touches = [
        f"corner_{i},{x:.7f},{y:.7f},{z:.7f}"
        for i, (x, y, z) in enumerate(rotation.apply(corners) + shift)
    ]
    (folder / "touches.csv").write_text("\n".join(["landmark,x,y,z", *touches]) + "\n")
    (folder / "rest.ply").write_bytes(ply_bytes(small_cloud()))
    _write_sequence(folder / "sequences" / "poke-01", start=100.0, sideways=0.0)
    _write_sequence(folder / "sequences" / "drag-01", start=200.0, sideways=0.015)
    forces = [f"{100 + i / 100:.3f},0.0,0.0,{0.01 * i:.4f}" for i in range(100)]
    (folder / "sequences" / "poke-01" / "forces.csv").write_text(
        "\n".join(["t,fx,fy,fz", *forces]) + "\n"
    )
    return folder


def small_cloud() -> np.ndarray:
    """The top and the table around it (192, 3) [m], camera frame."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 12), np.linspace(-0.5, 0.5, 8))
    top = np.stack([x * SIZE[0], y * SIZE[1], np.full_like(x, SIZE[2])], axis=-1).reshape(-1, 3)
    table = np.stack([x * 0.3, y * 0.3, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    rotation, shift = _CAMERA_FROM_PHANTOM
    return np.asarray(rotation.apply(np.concatenate([top, table])) + shift)


def _write_sequence(folder: Path, start: float, sideways: float) -> None:
    """One second at 200 Hz: down from 20 mm above the top to 3 mm into it, sideways on the way, and
    up again.
    """
    (folder / "clouds").mkdir(parents=True)
    rotation, shift = _ROBOT_FROM_PHANTOM
    time = np.arange(200) / 200
    depth = 0.023 * np.sin(np.pi * time)
    path = np.stack(
        [sideways * np.sin(np.pi * time), 0.002 + 0 * time, SIZE[2] + 0.005 + 0.020 - depth],
        axis=-1,
    )
    turn = rotation.as_quat()
    rows = [
        f"{start + t:.5f}," + ",".join(f"{v:.7f}" for v in (*p, *turn))
        for t, p in zip(time, rotation.apply(path) + shift, strict=True)
    ]
    (folder / "kinematics.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]) + "\n")
    for i in range(5):
        (folder / "clouds" / f"{i:06d}.ply").write_bytes(ply_bytes(small_cloud()))
    stamps = [f"{start + 0.1 + 0.2 * i:.5f},clouds/{i:06d}.ply" for i in range(5)]
    (folder / "clouds.csv").write_text("\n".join(["t,file", *stamps]) + "\n")
