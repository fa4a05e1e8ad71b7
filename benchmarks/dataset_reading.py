"""Time and memory of reading a recording of many large clouds, one at a time."""

from __future__ import annotations

import resource
import tempfile
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.cpu_time import timed
from palpate.dataset import open_dataset

__all__ = ["run", "write_recording"]

CLOUDS, POINTS = 300, 45_000
MANIFEST = """\
format = 1
name = "benchmark"

[phantom]
geometry = "box"
size = [0.0687, 0.0393, 0.0358]
mass = 0.104
fixed = "base"

[tool]
shape = "sphere"
radius = 0.005

[landmarks]
corner_0 = [0.03435, 0.01965, 0.0358]
corner_1 = [0.03435, -0.01965, 0.0358]
corner_2 = [-0.03435, -0.01965, 0.0358]
corner_3 = [-0.03435, 0.01965, 0.0358]

[camera]
name = "benchmark camera"
depth_sigma = 0.002

[splits]
train = ["long"]
validation = []
test = []
"""


def _ply(points: np.ndarray) -> bytes:
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{axes}end_header\n"
    )
    return header.encode() + points.astype("<f4").tobytes()


def write_recording(folder: Path, clouds: int, points: int) -> Path:
    """Write a dataset with one sequence of random clouds; return its folder."""
    rng = np.random.default_rng(0)
    home = folder / "sequences" / "long"
    (home / "clouds").mkdir(parents=True)
    (folder / "dataset.toml").write_text(MANIFEST)
    corners = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    touches = [
        f"corner_{i},{0.03435 * x},{0.01965 * y},0.0358\n" for i, (x, y) in enumerate(corners)
    ]
    (folder / "touches.csv").write_text("landmark,x,y,z\n" + "".join(touches))
    for number in range(clouds):
        cloud = rng.uniform([-0.05, -0.05, 0.30], [0.05, 0.05, 0.34], (points, 3))
        (home / "clouds" / f"{number:06d}.ply").write_bytes(_ply(cloud))
    (folder / "rest.ply").write_bytes(_ply(cloud))
    rows = [f"{number / 30:.6f},clouds/{number:06d}.ply" for number in range(clouds)]
    (home / "clouds.csv").write_text("t,file\n" + "\n".join(rows) + "\n")
    times = np.arange(0, clouds / 30, 1e-3)
    motion = [f"{t:.4f},{0.01 * np.sin(t):.6f},0.0,0.05,0,0,0,1" for t in times]
    (home / "kinematics.csv").write_text("t,x,y,z,qx,qy,qz,qw\n" + "\n".join(motion) + "\n")
    return folder


def run() -> list[Table]:
    """Open the recording and read every cloud; RuntimeError where points or memory are wrong."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_recording(Path(folder) / "recording", CLOUDS, POINTS)
        dataset, opening = timed(lambda: open_dataset(path))
        sequence, listing = timed(lambda: dataset.sequence("long"))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        counts, reading = timed(
            lambda: [len(sequence.cloud(index)) for index in range(len(sequence))]
        )
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if counts != [POINTS] * CLOUDS:
        raise RuntimeError(
            f"{CLOUDS} clouds of {POINTS} points were written, "
            f"{len(counts)} of {set(counts)} points were read"
        )
    if grown > 200:
        raise RuntimeError(
            f"reading cloud by cloud took {grown:.0f} MB more memory: clouds are not released"
        )
    table = Table("step", "amount", "time", title=f"Dataset of {CLOUDS} clouds of {POINTS} points")
    table.add_row("open and validate", f"{CLOUDS} headers", f"{opening * 1e3:.0f} ms")
    table.add_row(
        "open the sequence", f"{len(sequence.kinematics.time)} poses", f"{listing * 1e3:.0f} ms"
    )
    table.add_row("read a cloud", f"{POINTS} points", f"{reading / CLOUDS * 1e3:.1f} ms")
    return [table]
