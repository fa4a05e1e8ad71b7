"""Speed and memory of `palpate import`: 2 GB of a plain bag, and smaller ones of other kinds."""

from __future__ import annotations

import bz2
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.table import Table
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from benchmarks.dataset_reading import MANIFEST
from palpate.dataset import open_dataset

__all__ = ["run", "write_bag"]

Kind = Literal["ros1", "bz2", "lz4", "mcap"]
SIZES: dict[Kind, float] = {"ros1": 2e9, "mcap": 0.5e9, "lz4": 0.25e9, "bz2": 0.1e9}
"""Bytes of messages in each bag."""
ROWS, COLUMNS, FOCAL = 480, 640, 600.0
RATE, POSES = 30, 1000
"""Clouds and poses a second."""
TOP, CAMERA = 0.0358, 0.35
"""Height of the block's top, and distance of the camera above the table [m]."""
MEMORY = 2000
"""Largest resident memory of an import [MB]."""


class _Bag:
    """A bag under way: poses, forces and organised clouds with NaN."""

    def __init__(self, writer: Any, is_ros2: bool) -> None:
        self._writer, self._is_ros2 = writer, is_ros2
        self._types = get_typestore(Stores.ROS2_HUMBLE if is_ros2 else Stores.ROS1_NOETIC)
        self._connections: dict[str, Any] = {}

    def _make(self, kind: str, **values: Any) -> Any:
        return self._types.types[kind](**values)

    def _header(self, stamp: int, frame: str) -> Any:
        clock = self._make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        extra = {} if self._is_ros2 else {"seq": 0}
        return self._make("std_msgs/msg/Header", stamp=clock, frame_id=frame, **extra)

    def _write(self, topic: str, message: Any, stamp: int) -> None:
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._types
            )
        types = self._types
        packed = types.serialize_cdr if self._is_ros2 else types.serialize_ros1
        # Messages arrive 3 ms after their stamp.
        self._writer.write(self._connections[topic], stamp + 3_000_000, packed(message, kind))

    def pose(self, stamp: int, position: np.ndarray) -> None:
        """Write one pose; the tool points downwards."""
        x, y, z = map(float, position)
        pose = self._make(
            "geometry_msgs/msg/Pose",
            position=self._make("geometry_msgs/msg/Point", x=x, y=y, z=z),
            orientation=self._make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        )
        header = self._header(stamp, "base")
        self._write(
            "/PSM1/measured_cp",
            self._make("geometry_msgs/msg/PoseStamped", header=header, pose=pose),
            stamp,
        )

    def cloud(self, stamp: int, records: np.ndarray) -> None:
        """Write one organised cloud."""
        step = records.dtype.itemsize
        fields = [
            self._make("sensor_msgs/msg/PointField", name=name, offset=at, datatype=7, count=1)
            for name, at in (("x", 0), ("y", 4), ("z", 8), ("rgb", 16))
        ]
        message = self._make(
            "sensor_msgs/msg/PointCloud2",
            header=self._header(stamp, "camera"),
            height=ROWS,
            width=COLUMNS,
            fields=fields,
            is_bigendian=False,
            point_step=step,
            row_step=step * COLUMNS,
            data=np.frombuffer(records.tobytes(), dtype=np.uint8),
            is_dense=False,
        )
        self._write("/camera/points", message, stamp)


@contextmanager
def _bag(path: Path, kind: Kind) -> Iterator[_Bag]:
    if kind == "mcap":
        with Ros2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            yield _Bag(writer, True)
        return
    plain = Ros1Writer(path)
    if kind != "ros1":
        plain.set_compression(Ros1Writer.CompressionFormat[kind.upper()])
    with plain:
        yield _Bag(plain, False)


def _view(rng: np.random.Generator) -> np.ndarray:
    """A cloud of the block from above as its bytes are stored: x, y, z, a gap, a colour."""
    layout = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("gap", "<u4"), ("rgb", "<f4")])
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    slopes = (columns - COLUMNS / 2) / FOCAL, (rows - ROWS / 2) / FOCAL
    depth = np.full((ROWS, COLUMNS), CAMERA)
    over = CAMERA - TOP
    on_block = (np.abs(slopes[0] * over) < 0.0687 / 2) & (np.abs(slopes[1] * over) < 0.0393 / 2)
    depth[on_block] = over
    depth += rng.normal(0, 5e-4, depth.shape)
    depth[rng.random(depth.shape) < 0.2] = np.nan
    records = np.zeros((ROWS, COLUMNS), dtype=layout)
    records["x"], records["y"], records["z"] = slopes[0] * depth, slopes[1] * depth, depth
    return records


def write_bag(path: Path, kind: Kind, size: float) -> float:
    """Write a recording of about `size` bytes: a tool pushes every 3 s; returns its length [s]."""
    rng = np.random.default_rng(0)
    views = [_view(rng) for _ in range(4)]
    clouds = max(8, int(size / views[0].nbytes))
    began = 1_700_000_000 * 10**9
    with _bag(path, kind) as bag:
        for at in range(clouds):
            bag.cloud(began + at * 10**9 // RATE, views[at % len(views)])
            for part in range(POSES // RATE):
                seconds = at / RATE + part / POSES
                height = TOP + 0.005 + 0.012 * np.cos(2 * np.pi * seconds / 3)
                bag.pose(began + round(seconds * 1e9), np.array([0.004, 0.002, height]))
    return clouds / RATE


def _setup(folder: Path) -> Path:
    """Write dataset.toml and touches.csv without splits; returns the former."""
    head = MANIFEST.partition("[splits]")[0]
    (folder / "dataset.toml").write_text(head)
    corners = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    rows = [f"corner_{n},{0.03435 * x},{0.01965 * y},0.0358" for n, (x, y) in enumerate(corners)]
    (folder / "touches.csv").write_text("landmark,x,y,z\n" + "\n".join(rows) + "\n")
    return folder / "dataset.toml"


def _imported(folder: Path, bag: Path) -> tuple[float, float]:
    """Import in a process of its own; returns CPU time [s] and peak memory [MB]."""
    code = (
        "import resource, sys; from pathlib import Path\n"
        "from palpate.importing.import_notes import ImportNotes\n"
        "from palpate.importing.import_recording import import_recordings\n"
        "from palpate.importing.survey import survey\n"
        "bag, setup, to = map(Path, sys.argv[1:])\n"
        "notes = ImportNotes()\n"
        "found = survey([bag, setup.parent / 'touches.csv'], setup)\n"
        "mapping = found.proposal('bench', notes)\n"
        "found.close()\n"
        "import_recordings(mapping, Path.cwd(), to, notes)\n"
        "used = resource.getrusage(resource.RUSAGE_SELF)\n"
        "print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(bag), str(_setup(folder)), str(folder / "made")],
        check=False,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"import of {bag.name} failed: {done.stderr.strip()[-400:]}")
    seconds, memory = map(float, done.stdout.split())
    return seconds, memory


def _reference(bag: Path, kind: Kind) -> float:
    """CPU time [s] that reading the file takes, or unpacking as many bytes of a bz2 bag."""
    begin = time.process_time()
    files = [bag] if bag.is_file() else sorted(bag.iterdir())
    for file in files:
        with file.open("rb") as stream:
            while stream.read(2**22):
                pass
    if kind != "bz2":
        return time.process_time() - begin
    packed = [bz2.compress(_view(np.random.default_rng(n)).tobytes()) for n in range(4)]
    begin = time.process_time()
    unpacked = sum(len(bz2.decompress(one)) for one in packed)
    return (time.process_time() - begin) * SIZES[kind] / unpacked


def run() -> list[Table]:
    """Import bags of each kind; RuntimeError where clouds are lost or memory is too large."""
    table = Table(
        "bag", "messages", "recorded", "import, CPU", "speed", "real time", "peak memory",
        "reading alone",
        title="Import of bags: VGA clouds at 30 Hz, poses at 1 kHz",
    )  # fmt: skip
    for kind, size in SIZES.items():
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            bag = folder / ("recording" if kind == "mcap" else "recording.bag")
            length = write_bag(bag, kind, size)
            seconds, memory = _imported(folder, bag)
            reference = _reference(bag, kind)
            _check(folder / "made", length)
        if memory > MEMORY:
            raise RuntimeError(f"import of {bag.name} took {memory:.0f} MB; at most {MEMORY}")
        table.add_row(
            kind, f"{size / 1e9:g} GB", f"{length:.0f} s", f"{seconds:.1f} s",
            f"{size / seconds / 1e6:.0f} MB/s", f"{length / seconds:.1f} times",
            f"{memory:.0f} MB", f"{reference:.1f} s",
        )  # fmt: skip
    return [table]


def _check(folder: Path, length: float) -> None:
    """RuntimeError where the pushes are not found, or a cloud has lost points."""
    dataset = open_dataset(folder)
    pushes = int((length - 1.5) / 3)
    if abs(len(dataset.sequences) - pushes) > 1:
        raise RuntimeError(f"{len(dataset.sequences)} pushes were found where {pushes} are")
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        points = len(sequence.cloud(0))
        share = points / (ROWS * COLUMNS)
        if not 0.78 < share < 0.82:
            raise RuntimeError(f"{name}: {share:.3f} of the pixels are in a cloud, 0.8 were seen")
