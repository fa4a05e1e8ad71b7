"""A recording of a pushed block, made in a second: robot, forces and clouds that agree.

The top is pressed from above at several places and one side once; forces follow Hertz' law, the
clouds show block, table, ball and shaft from one camera. The truth stands beside the folder.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation
from small_dataset import SIZE, TOML, ply_bytes

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["write_recorded_block"]

RADIUS, SHAFT, MODULUS, POISSON = 0.005, 0.004, 5e3, 0.45
CAMERA = np.array([-0.19, -0.21, 0.26])
ROBOT = Transform(
    Rotation.from_euler("xyz", [0.4, -0.6, 0.9]).as_matrix(), np.array([0.12, -0.05, 0.2])
)
UP, OUT = np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0])
PUSHES = {
    "poke-side-01": [((-SIZE[0] / 2, 0.004, 0.022), OUT, 0.004)],
    "poke-top-01": [((0.02, 0.008, SIZE[2]), UP, 0.005), ((-0.015, -0.006, SIZE[2]), UP, 0.004)],
    "poke-top-02": [((-0.022, 0.009, SIZE[2]), UP, 0.004), ((0.012, -0.01, SIZE[2]), UP, 0.006)],
}
"""Place on the surface [m], outward normal and depth [m] of each push."""
HOVER, RATE, FRAMES = 0.022, 100.0, 4.0


def write_recorded_block(folder: Path) -> Path:
    """Write the dataset and its truth; returns the folder."""
    random = np.random.default_rng(5)
    pose = _looking(CAMERA, np.array([0.0, 0.0, SIZE[2] / 2]))
    folder.mkdir(parents=True)
    splits = 'train = ["poke-side-01", "poke-top-01"]\nvalidation = []\ntest = ["poke-top-02"]\n'
    toml = TOML.split("[splits]")[0] + "[splits]\n" + splits
    (folder / "dataset.toml").write_text(toml)
    corners = np.array([[a * SIZE[0] / 2, b * SIZE[1] / 2, SIZE[2]] for a, b in _CORNERS])
    touched = ROBOT.apply(corners) + 1e-4 * random.normal(size=corners.shape)
    rows = [f"corner_{i},{x:.7f},{y:.7f},{z:.7f}" for i, (x, y, z) in enumerate(touched)]
    (folder / "touches.csv").write_text("\n".join(["landmark,x,y,z", *rows]) + "\n")
    body = _block(random)
    (folder / "rest.ply").write_bytes(ply_bytes(_seen(body, pose, random)))
    for start, (name, pushes) in enumerate(PUSHES.items(), 1):
        _sequence(folder / "sequences" / name, pushes, 20.0 * start, pose, random)
    truth = {
        "robot_from_phantom_R": ROBOT.rotation.tolist(),
        "robot_from_phantom_t": ROBOT.translation.tolist(),
        "phantom_from_camera": pose.matrix.tolist(),
    }
    Path(f"{folder}.truth.json").write_text(json.dumps({"registration": truth}))
    return folder


_CORNERS = ((1, 1), (1, -1), (-1, -1), (-1, 1))


def _looking(eye: FloatArray, target: FloatArray) -> Transform:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right)
    return Transform(np.stack([right, np.cross(forward, right), forward], axis=1), eye)


def _block(random: np.random.Generator) -> FloatArray:
    """Points (n, 3) [m] of the top, the two sides that the camera sees, and the table."""
    x, y, z = SIZE
    flat = random.uniform(-0.5, 0.5, (5200, 2))
    top = np.column_stack([flat[:1200] * [x, y], np.full(1200, z)])
    high = random.uniform(0, z, 800)
    sides = [
        np.column_stack([np.full(400, -x / 2), flat[1200:1600, 0] * y, high[:400]]),
        np.column_stack([flat[1600:2000, 0] * x, np.full(400, -y / 2), high[400:]]),
    ]
    table = np.column_stack([flat[2000:] * 0.26, np.zeros(3200)])
    table = table[~((np.abs(table[:, 0]) < x / 2) & (np.abs(table[:, 1]) < y / 2))]
    return np.concatenate([top, *sides, table])


def _tool(centre: FloatArray, axis: FloatArray, random: np.random.Generator) -> FloatArray:
    """Points (n, 3) [m] of the front of ball and shaft."""
    ball = random.normal(size=(120, 3))
    ball = centre + RADIUS * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    angle, height = random.uniform(0, 2 * np.pi, 500), random.uniform(0.004, 0.08, 500)
    one = np.cross(axis, [0.3, 0.8, 0.52])
    one /= np.linalg.norm(one)
    round_ = np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * np.cross(axis, one)
    shaft = centre + height[:, None] * axis + SHAFT * round_
    points = np.concatenate([ball, shaft])
    outward = np.concatenate([ball - centre, round_])
    return points[np.einsum("ni,ni->n", outward, CAMERA - points) > 0]


def _seen(points: FloatArray, pose: Transform, random: np.random.Generator) -> FloatArray:
    """Points (n, 3) [m] in the camera frame, with noise along the line of sight."""
    seen = pose.inverse().apply(points)
    return seen * (
        1 + 6e-4 * random.normal(size=(len(seen), 1)) / np.linalg.norm(seen, axis=1)[:, None]
    )


def _sequence(
    home: Path,
    pushes: Sequence[tuple[tuple[float, ...], FloatArray, float]],
    start: float,
    pose: Transform,
    random: np.random.Generator,
) -> None:
    """Pushes one after the other, six seconds each and of uneven speed."""
    time: list[FloatArray] = []
    centres: list[FloatArray] = []
    forces: list[FloatArray] = []
    axis = pushes[0][1]
    for number, (place, normal, depth) in enumerate(pushes):
        t = np.arange(0.0, 6.0 + number, 1 / RATE)
        arc = np.interp(t, [0, 1.2, 2.6, 3.6 + number, 5 + number, 9], [0, 0, 1, 1, 0, 0])
        way = -HOVER + (HOVER + depth) * arc
        centres.append(np.array(place) + (RADIUS - way)[:, None] * normal)
        stiff = 4 / 3 * MODULUS / (1 - POISSON**2) * np.sqrt(RADIUS)
        forces.append((stiff * np.maximum(way, 0) ** 1.5)[:, None] * normal)
        time.append(t + (time[-1][-1] + 1.0 if time else start))
    t, centre, force = np.concatenate(time), np.concatenate(centres), np.concatenate(forces)
    grid = np.arange(t[0], t[-1], 1 / RATE)
    centre, force = (
        np.stack([np.interp(grid, t, column) for column in rows.T], axis=-1)
        for rows in (centre, force)
    )
    (home / "clouds").mkdir(parents=True)
    turn = Rotation.align_vectors(ROBOT.rotate(axis[None]), [[0.0, 0.0, -1.0]])[0]
    spun = turn * Rotation.from_rotvec([0.0, 0.0, 0.7])
    robot = ROBOT.apply(centre) + 3e-5 * random.normal(size=centre.shape)
    pairs = {
        "kinematics.csv": (
            "t,x,y,z,qx,qy,qz,qw",
            np.column_stack([grid, robot, np.tile(spun.as_quat(), (len(grid), 1))]),
        ),
        "forces.csv": (
            "t,fx,fy,fz",
            np.column_stack(
                [grid, ROBOT.rotate(force) + 0.03 + 4e-3 * random.normal(size=force.shape)]
            ),
        ),
    }
    for name, (header, rows) in pairs.items():
        lines = [",".join(f"{value:.7f}" for value in row) for row in rows]
        (home / name).write_text("\n".join([header, *lines]) + "\n")
    listed = []
    for number, row in enumerate(range(0, len(grid), round(RATE / FRAMES))):
        points = np.concatenate([_block(random), _tool(centre[row], axis, random)])
        (home / f"clouds/{number:06d}.ply").write_bytes(ply_bytes(_seen(points, pose, random)))
        listed.append(f"{grid[row]:.5f},clouds/{number:06d}.ply")
    (home / "clouds.csv").write_text("\n".join(["t,file", *listed]) + "\n")
