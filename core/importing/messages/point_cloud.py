"""Points of sensor_msgs/PointCloud2 messages: any fields, padding and byte order."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = ["cloud_points"]

_KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""NumPy types by the numbers in sensor_msgs/PointField."""


def cloud_points(message: Any) -> FloatArray:
    """Read x, y, z of a PointCloud2 message.

    Returns:
        points [m]: (rows, columns, 3) of an organised cloud, (n, 3) otherwise; NaN where x, y, z
        are not finite, or all zero, as cameras write what they did not measure.

    Raises DatasetError where a coordinate is missing, or the data are shorter than stated.
    """
    columns = [_column(message, axis) for axis in "xyz"]
    points = np.stack(columns, axis=-1)
    with np.errstate(invalid="ignore"):
        bad = ~np.isfinite(points).all(axis=-1) | (points == 0).all(axis=-1)
    points[bad] = np.nan
    return points if message.height > 1 else points.reshape(-1, 3)


def _column(message: Any, axis: str) -> FloatArray:
    """One coordinate (rows, columns), copied out of the packed bytes."""
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
    view = np.ndarray(
        (rows, columns), dtype=kind, buffer=data.data, offset=field.offset, strides=(stride, step)
    )
    return view.astype(float)
