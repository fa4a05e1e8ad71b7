"""Types of messages: the kind of their stream, and how they are decoded."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.messages.depth_messages import compressed_depth, raw_depth
from palpate.importing.messages.point_cloud import cloud_points
from palpate.importing.stream import StreamKind

__all__ = ["KINDS", "MessageKind", "header_of", "nested_transforms", "packed_numbers"]


@dataclass(frozen=True)
class MessageKind:
    """How a type of message is read.

    Attributes:
        kind: of its stream.
        has_header: whether it begins with a std_msgs/Header.
        decode: makes the array of a sample, see `Sample.value`.
        packed: number of doubles that follow the header and are the whole sample; 0 for others.
    """

    kind: StreamKind
    has_header: bool
    decode: Callable[[Any], FloatArray]
    packed: int = 0


def header_of(raw: bytes, is_ros2: bool) -> tuple[int, str]:
    """Stamp [ns] and frame id of a serialised message that begins with a std_msgs/Header."""
    if is_ros2:
        order = "<" if raw[1] & 1 else ">"
        seconds, nanoseconds, length = struct.unpack_from(order + "iII", raw, 4)
        name = raw[16 : 16 + max(0, length - 1)]
    else:
        seconds, nanoseconds, length = struct.unpack_from("<III", raw, 4)
        name = raw[16 : 16 + length]
    return seconds * 10**9 + nanoseconds, bytes(name).decode("utf-8", "replace")


def packed_numbers(raw: bytes, is_ros2: bool, count: int) -> FloatArray:
    """Doubles (count,) that follow the header of a serialised message.

    Measured: ten times as fast as through an object of the message, which matters at 1 kHz.
    """
    order = ">" if is_ros2 and not raw[1] & 1 else "<"
    (length,) = struct.unpack_from(order + "I", raw, 12)
    start = 16 + length
    if is_ros2:
        # CDR aligns doubles to 8 bytes, counted from behind its 4 bytes of encapsulation.
        start = 4 + -(-(start - 4) // 8) * 8
    return np.frombuffer(raw, dtype=order + "f8", count=count, offset=start).astype(float)


def nested_transforms(message: Any) -> list[tuple[str, str, int, FloatArray]]:
    """Parent, child, stamp [ns] and pose (7,) of each transform in a TFMessage."""
    return [
        (
            one.header.frame_id,
            one.child_frame_id,
            one.header.stamp.sec * 10**9 + one.header.stamp.nanosec,
            _transform(one),
        )
        for one in message.transforms
    ]


def _transform(message: Any) -> FloatArray:
    return _numbers(message.transform.translation, message.transform.rotation)


def _pose(message: Any) -> FloatArray:
    return _numbers(message.position, message.orientation)


def _pose_stamped(message: Any) -> FloatArray:
    return _pose(message.pose)


def _wrench(message: Any) -> FloatArray:
    force, torque = message.force, message.torque
    return np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])


def _wrench_stamped(message: Any) -> FloatArray:
    return _wrench(message.wrench)


def _intrinsics(message: Any) -> FloatArray:
    """Rows, columns, matrix (9,), and as many coefficients of distortion as there are."""
    matrix = message.k if hasattr(message, "k") else message.K
    bent = np.asarray(message.d if hasattr(message, "d") else message.D, dtype=float)
    model = message.distortion_model
    if bent.any() and model not in ("plumb_bob", "rational_polynomial"):
        raise DatasetError(
            f"the camera's distortion is '{model}'; expected plumb_bob or rational_polynomial: "
            "record rectified images",
            value=model,
        )
    return np.concatenate([[message.height, message.width], np.asarray(matrix, dtype=float), bent])


def _joints(message: Any) -> FloatArray:
    return np.asarray(message.position, dtype=float)


def _numbers(place: Any, turn: Any) -> FloatArray:
    return np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])


KINDS = {
    "geometry_msgs/msg/PoseStamped": MessageKind("pose", True, _pose_stamped, packed=7),
    "geometry_msgs/msg/TransformStamped": MessageKind("pose", True, _transform),
    "geometry_msgs/msg/Pose": MessageKind("pose", False, _pose),
    "geometry_msgs/msg/WrenchStamped": MessageKind("wrench", True, _wrench_stamped, packed=6),
    "geometry_msgs/msg/Wrench": MessageKind("wrench", False, _wrench),
    "sensor_msgs/msg/PointCloud2": MessageKind("cloud", True, cloud_points),
    "sensor_msgs/msg/Image": MessageKind("depth", True, raw_depth),
    "sensor_msgs/msg/CompressedImage": MessageKind("depth", True, compressed_depth),
    "sensor_msgs/msg/CameraInfo": MessageKind("camera", True, _intrinsics),
    "sensor_msgs/msg/JointState": MessageKind("joints", True, _joints),
}
"""By the name of the type, as in ROS 2."""
