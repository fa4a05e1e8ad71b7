"""Bags of ROS 1 and ROS 2, written by rosbags from arrays, as a bench would record them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from palpate.dataset import open_dataset

__all__ = ["BAG_KINDS", "BagKind", "WrittenBag", "write_sequence_bag", "written_bag"]

BagKind = Literal["ros1", "bz2", "lz4", "sqlite3", "mcap"]
BAG_KINDS: tuple[BagKind, ...] = ("ros1", "bz2", "lz4", "sqlite3", "mcap")
_STORES: dict[bool, Any] = {}


def _store(is_ros2: bool) -> Any:
    if is_ros2 not in _STORES:
        store = get_typestore(Stores.ROS2_HUMBLE if is_ros2 else Stores.ROS1_NOETIC)
        if not is_ros2:
            text = "geometry_msgs/TransformStamped[] transforms"
            store.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
        _STORES[is_ros2] = store
    return _STORES[is_ros2]


@dataclass
class WrittenBag:
    """A bag under way; times are nanoseconds."""

    writer: Any
    is_ros2: bool
    connections: dict[str, Any] = field(default_factory=dict)

    def make(self, kind: str, /, **values: Any) -> Any:
        return _store(self.is_ros2).types[kind](**values)

    def header(self, stamp: int, frame: str) -> Any:
        time = self.make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
        extra = {} if self.is_ros2 else {"seq": 0}
        return self.make("std_msgs/msg/Header", stamp=time, frame_id=frame, **extra)

    def write(self, topic: str, message: Any, received: int) -> None:
        kind = message.__msgtype__
        store = _store(self.is_ros2)
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=store)
        code = store.serialize_cdr if self.is_ros2 else store.serialize_ros1
        self.writer.write(self.connections[topic], received, bytes(code(message, kind)))

    def _point(self, name: str, values: Iterable[float]) -> Any:
        keys = ("x", "y", "z", "w")
        return self.make(
            f"geometry_msgs/msg/{name}",
            **{key: float(one) for key, one in zip(keys, values, strict=False)},
        )

    def pose(self, topic: str, stamp: int, received: int, pose: np.ndarray, frame: str) -> None:
        inner = self.make(
            "geometry_msgs/msg/Pose",
            position=self._point("Point", pose[:3]),
            orientation=self._point("Quaternion", pose[3:]),
        )
        message = self.make(
            "geometry_msgs/msg/PoseStamped", header=self.header(stamp, frame), pose=inner
        )
        self.write(topic, message, received)

    def transform(self, stamp: int, pose: np.ndarray, frame: str, child: str) -> Any:
        inner = self.make(
            "geometry_msgs/msg/Transform",
            translation=self._point("Vector3", pose[:3]),
            rotation=self._point("Quaternion", pose[3:]),
        )
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(stamp, frame),
            child_frame_id=child,
            transform=inner,
        )

    def tf(self, topic: str, transforms: list[Any], received: int) -> None:
        self.write(topic, self.make("tf2_msgs/msg/TFMessage", transforms=transforms), received)

    def wrench(self, topic: str, stamp: int, received: int, force: np.ndarray, frame: str) -> None:
        inner = self.make(
            "geometry_msgs/msg/Wrench",
            force=self._point("Vector3", force),
            torque=self._point("Vector3", np.zeros(3)),
        )
        message = self.make(
            "geometry_msgs/msg/WrenchStamped", header=self.header(stamp, frame), wrench=inner
        )
        self.write(topic, message, received)

    def cloud(self, topic: str, stamp: int, received: int, points: np.ndarray, frame: str) -> None:
        """Points (n, 3) or (rows, columns, 3) with four bytes of padding and a colour."""
        layout = np.dtype(
            [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("gap", "<u4"), ("rgb", "<f4")]
        )
        rows, columns = points.shape[:2] if points.ndim == 3 else (1, len(points))
        records = np.zeros((rows, columns), dtype=layout)
        for axis, name in enumerate("xyz"):
            records[name] = points[..., axis].reshape(rows, columns)
        fields = [
            self.make("sensor_msgs/msg/PointField", name=name, offset=at, datatype=7, count=1)
            for name, at in (("x", 0), ("y", 4), ("z", 8), ("rgb", 16))
        ]
        message = self.make(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(stamp, frame),
            height=rows,
            width=columns,
            fields=fields,
            is_bigendian=False,
            point_step=layout.itemsize,
            row_step=layout.itemsize * columns,
            data=np.frombuffer(records.tobytes(), dtype=np.uint8),
            is_dense=False,
        )
        self.write(topic, message, received)

    def image(self, topic: str, stamp: int, received: int, depth: np.ndarray, frame: str) -> None:
        """A depth image as it is stored: uint16 [mm], or float32 [m]."""
        coding = "16UC1" if depth.dtype == np.uint16 else "32FC1"
        message = self.make(
            "sensor_msgs/msg/Image",
            header=self.header(stamp, frame),
            height=depth.shape[0],
            width=depth.shape[1],
            encoding=coding,
            is_bigendian=0,
            step=depth.shape[1] * depth.itemsize,
            data=np.frombuffer(depth.tobytes(), dtype=np.uint8),
        )
        self.write(topic, message, received)

    def compressed(self, topic: str, stamp: int, received: int, data: bytes, text: str) -> None:
        message = self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(stamp, "camera"),
            format=text,
            data=np.frombuffer(data, dtype=np.uint8),
        )
        self.write(topic, message, received)

    def camera_info(
        self, topic: str, stamp: int, received: int, size: tuple[int, int], matrix: np.ndarray,
        bent: np.ndarray,
    ) -> None:  # fmt: skip
        roi = self.make(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False,
        )  # fmt: skip
        numbers = {"d": bent, "k": matrix.ravel(), "r": np.eye(3).ravel(), "p": np.zeros(12)}
        if not self.is_ros2:
            numbers = {key.upper(): one for key, one in numbers.items()}
        message = self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(stamp, "camera"),
            height=size[0],
            width=size[1],
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=roi,
            **numbers,
        )
        self.write(topic, message, received)

    def joints(self, topic: str, stamp: int) -> None:
        none = np.zeros(0)
        message = self.make(
            "sensor_msgs/msg/JointState",
            header=self.header(stamp, ""),
            name=["a"],
            position=np.zeros(1),
            velocity=none,
            effort=none,
        )
        self.write(topic, message, stamp)


@contextmanager
def written_bag(path: Path, kind: BagKind) -> Iterator[WrittenBag]:
    """Write a bag at `path`: a .bag file of ROS 1, or a folder of ROS 2."""
    if kind in ("sqlite3", "mcap"):
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        with Ros2Writer(path, version=9, storage_plugin=plugin) as writer:
            yield WrittenBag(writer, True)
        return
    writer1 = Ros1Writer(path)
    if kind != "ros1":
        writer1.set_compression(Ros1Writer.CompressionFormat[kind.upper()])
    with writer1:
        yield WrittenBag(writer1, False)


def write_sequence_bag(dataset: Path, name: str, path: Path, kind: BagKind) -> None:
    """Write one sequence of a dataset as a bag: measured_cp, points, and wrench where there is."""
    sequence = open_dataset(dataset).sequence(name)
    poses = np.concatenate([sequence.kinematics.position, sequence.kinematics.quaternion], axis=1)
    events: list[tuple[int, int, int]] = [
        *((_stamp(time), 0, at) for at, time in enumerate(sequence.kinematics.time)),
        *((_stamp(time), 1, at) for at, time in enumerate(sequence.cloud_times)),
    ]
    if sequence.forces is not None:
        events += [(_stamp(time), 2, at) for at, time in enumerate(sequence.forces.time)]
    with written_bag(path, kind) as bag:
        for stamp, role, at in sorted(events):
            received = stamp + 3_000_000
            if role == 0:
                bag.pose("/PSM1/measured_cp", stamp, received, poses[at], "PSM1_base")
            elif role == 1:
                bag.cloud("/camera/points", stamp, received, sequence.cloud(at), "camera_optical")
            elif sequence.forces is not None:
                force = sequence.forces.force[at]
                bag.wrench("/wrench", stamp, received, force, "PSM1_base")


def _stamp(time: float) -> int:
    return round(time * 1e9)
