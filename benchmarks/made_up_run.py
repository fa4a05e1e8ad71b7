"""A made-up dataset of large clouds with a run, for a server to show; nothing is solved."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec, box_mesh

__all__ = ["CAMERA", "RUN", "SEQUENCE", "cloud", "write_run"]

RUN, SEQUENCE = "large-1", "poke-top-01"
SIZE = (0.0687, 0.0393, 0.0358)
CAMERA = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.3], [0, 0, 0, 1]])
"""phantom_from_camera of a camera above the block, looking down."""
RADIUS = 5e-3
CORNERS = {
    f"corner_{number}": (x * SIZE[0] / 2, y * SIZE[1] / 2, SIZE[2])
    for number, (x, y) in enumerate(((1, 1), (1, -1), (-1, -1), (-1, 1)))
}
LANDMARKS = "\n".join(f"{name} = {list(place)}" for name, place in CORNERS.items())
TOML = f"""\
format = 1
name = "large"
[phantom]
geometry = "box"
size = {list(SIZE)}
mass = 0.104
fixed = "base"
[tool]
shape = "sphere"
radius = {RADIUS}
[landmarks]
{LANDMARKS}
[camera]
name = "made up"
depth_sigma = 0.002
[splits]
train = ["{SEQUENCE}"]
validation = []
test = []
"""


def cloud(frame: int, points: int) -> FloatArray:
    """Return points (n, 3) [m] of top and table, camera frame, which differ between frames."""
    rng = np.random.default_rng(frame)
    x, y = rng.uniform(-0.06, 0.06, (2, points))
    on = (np.abs(x) < SIZE[0] / 2) & (np.abs(y) < SIZE[1] / 2)
    z = np.where(on, 0.3 - SIZE[2], 0.3) + rng.normal(0.0, 5e-4, points)
    return np.asarray(np.column_stack([x, y, z]), dtype=np.float32)


def write_run(folder: Path, frames: int, points: int, nodes: tuple[int, int, int]) -> None:
    """Write the dataset `folder`/datasets/large and the run `folder`/runs/large-1.

    Args:
        folder: folder of datasets and runs.
        frames: number of frames.
        points: number of points of a cloud.
        nodes: nodes of the mesh along x, y, z.
    """
    data, run = folder / "datasets" / "large", folder / "runs" / RUN
    sequence = data / "sequences" / SEQUENCE
    (sequence / "clouds").mkdir(parents=True)
    (run / "replays").mkdir(parents=True)
    (data / "dataset.toml").write_text(TOML)
    (data / "touches.csv").write_text(
        "landmark,x,y,z\n" + "".join(f"{name},{x},{y},{z}\n" for name, (x, y, z) in CORNERS.items())
    )
    _write_ply(data / "rest.ply", cloud(0, points))
    times = np.arange(frames) / 30
    poses = "".join(f"{t},0,0,{0.05 - 1e-4 * i},0,0,0,1\n" for i, t in enumerate(times))
    (sequence / "kinematics.csv").write_text("t,x,y,z,qx,qy,qz,qw\n" + poses)
    (sequence / "clouds.csv").write_text(
        "t,file\n" + "".join(f"{t},clouds/{i:06d}.ply\n" for i, t in enumerate(times))
    )
    for frame in range(frames):
        _write_ply(sequence / "clouds" / f"{frame:06d}.ply", cloud(frame, points))
    (run / "report.json").write_text(
        json.dumps({"format": 1, "dataset": "large", "verdict": "none", "causes": []})
    )
    (run / "model.json").write_text(json.dumps({"format": 1}))
    (run / "origin.json").write_text(json.dumps({"dataset": str(data), "created": 1.0}))
    np.savez(run / "replays" / f"{SEQUENCE}.npz", **_arrays(frames, nodes))  # type: ignore[arg-type]


def _write_ply(file: Path, points: FloatArray) -> None:
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    file.write_bytes(header.encode() + points.astype("<f4").tobytes())


def _arrays(frames: int, nodes: tuple[int, int, int]) -> dict[str, object]:
    mesh = box_mesh(SIZE, GridSpec(nodes=nodes))
    used, inverse = np.unique(mesh.free_surface, return_inverse=True)
    rest, quads = mesh.nodes[used], inverse.reshape(-1, 4)
    depth = 4e-3 * np.sin(np.linspace(0.1, 3.0, frames))
    near = np.exp(-((np.linalg.norm(rest[:, :2], axis=1) / 0.01) ** 2)) * rest[:, 2] / SIZE[2]
    moved = rest - np.array([0.0, 0.0, 1.0]) * (depth[:, None] * near)[..., None]
    error = (0.2 * depth[:, None] * np.sin(100 * rest[:, 0])).astype(np.float32)
    tool = np.column_stack([np.zeros(frames), np.zeros(frames), SIZE[2] + RADIUS - depth])
    models = {
        key: value
        for model in ("raw", "extended")
        for key, value in {
            model: moved.astype(np.float32),
            f"tool_{model}": tool,
            f"tool_radius_{model}": RADIUS,
            f"error_{model}": error,
            f"distance_{model}": 0.2 * depth,
            f"paper_{model}": depth,
            f"camera_{model}": CAMERA,
        }.items()
    }
    return {
        "time": np.arange(frames) / 30,
        "cloud_index": np.arange(frames),
        "rest": rest,
        "noise_floor": 1e-5,
        "faces": np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32),
        "outcome": np.zeros(frames, np.int8),
        **models,
    }
