"""Points of sensor_msgs/PointCloud2 messages: any fields, padding and byte order."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.errors import DatasetError

__all__ = ["cloud_points", "unmeasured"]

_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""NumPy types by the numbers in sensor_msgs/PointField."""


def cloud_points(message: Any) -> FloatArray:
    """Read x, y, z of a PointCloud2 message.

    Returns:
        points [m] in the precision of the message: (rows, columns, 3) of an organised cloud, (n, 3)
        otherwise; NaN where x, y, z are not finite, or all zero, as cameras write what they did not
        measure.

    Raises DatasetError where a coordinate is missing, or the data are shorter than stated.
    """
    x, y, z = (_column(message, axis) for axis in "xyz")
    points = np.empty((*x.shape, 3), dtype=x.dtype.newbyteorder("="))
    points[..., 0], points[..., 1], points[..., 2] = x, y, z
    bad = unmeasured(points)
    if bad.any():
        # Cameras write NaN themselves, and writing single points takes as long as all the rest.
        bad &= ~(np.isnan(x) & np.isnan(y) & np.isnan(z))
        points[bad] = np.nan
    return points if message.height > 1 else points.reshape(-1, 3)


def unmeasured(points: FloatArray) -> BoolArray:
    """Whether each of points (..., 3) is all zero or not finite."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    with np.errstate(invalid="ignore", over="ignore"):
        # Measured: a third of the time of `isfinite(points).all(axis=-1)`.
        bad = ~np.isfinite(x + y + z)
        zero = z == 0
        if zero.any():
            bad |= zero & (x == 0) & (y == 0)
    return np.asarray(bad)


def _column(message: Any, axis: str) -> np.ndarray[Any, Any]:
    """One coordinate (rows, columns) within the packed bytes."""
    field = next((one for one in message.fields if one.name == axis), None)
    if field is None:
        names = ", ".join(one.name for one in message.fields)
        raise DatasetError(
            f"a PointCloud2 has no field {axis}, only {names or 'none'}; expected x, y and z: name "
            "another topic",
            key=axis,
        )
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(order + _KINDS[field.datatype])
    rows, columns = int(message.height), int(message.width)
    step, stride = int(message.point_step), int(message.row_step) or columns * message.point_step
    data = np.asarray(message.data, dtype=np.uint8)
    needed = (rows - 1) * stride + columns * step if rows and columns else 0
    if data.size < needed or field.offset + kind.itemsize > step:
        raise DatasetError(
            f"a PointCloud2 of {rows} x {columns} points needs {needed} bytes, {data.size} are "
            "there; expected all of them: the recording is damaged here",
            key=axis,
            value=data.size,
        )
    return np.ndarray(
        (rows, columns), dtype=kind, buffer=data.data, offset=field.offset, strides=(stride, step)
    )
