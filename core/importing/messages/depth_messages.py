"""Depth images in messages: 16UC1 in millimetres and 32FC1 in metres, raw or compressed."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = ["compressed_depth", "depth_from_png", "raw_depth"]

_HEADER = struct.Struct("<iff")
"""Header of compressedDepth before the PNG: its format, and two numbers of its quantisation."""
_TYPES = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}


def raw_depth(message: Any) -> FloatArray:
    """Depth (rows, columns) [m] of a sensor_msgs/Image; NaN where it is 0 or not finite."""
    if message.encoding not in _TYPES:
        raise DatasetError(
            f"an image of encoding {message.encoding} is no depth image; expected 16UC1 "
            "(millimetres) or 32FC1 (metres): name another topic",
            value=message.encoding,
        )
    kind = np.dtype((">" if message.is_bigendian else "<") + _TYPES[message.encoding])
    rows, columns = int(message.height), int(message.width)
    step = int(message.step) or columns * kind.itemsize
    data = np.asarray(message.data, dtype=np.uint8)
    if data.size < (rows - 1) * step + columns * kind.itemsize:
        raise DatasetError(
            f"an image of {rows} x {columns} pixels has only {data.size} bytes; expected all of "
            "them: the recording is damaged here",
            value=data.size,
        )
    view = np.ndarray((rows, columns), dtype=kind, buffer=data.data, strides=(step, kind.itemsize))
    return _metres(view)


def compressed_depth(message: Any) -> FloatArray:
    """Depth (rows, columns) [m] of a sensor_msgs/CompressedImage.

    The data begin with 12 bytes: a number and a, b; of 32FC1 the PNG holds a / depth + b. Source:
    compressed_depth_image_transport, whose RVL is not read.
    """
    data = np.asarray(message.data, dtype=np.uint8).tobytes()
    text = message.format
    if "compressedDepth" not in text and not data.startswith(b"\x89PNG"):
        raise DatasetError(
            f"a compressed image of format '{text}' is no depth image; expected compressedDepth "
            "with PNG: name another topic",
            value=text,
        )
    start = data.find(b"\x89PNG", 0, 64)
    if start < 0:
        raise DatasetError(
            f"a compressed depth image of format '{text}' holds no PNG; expected PNG: record it "
            "with png_level, not as RVL",
            value=text,
        )
    if text.startswith("32FC1") and start == _HEADER.size:
        _, scale, shift = _HEADER.unpack_from(data)
        levels = _png(data[start:]).astype(float)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = scale / (levels - shift)
        return np.where((levels > 0) & np.isfinite(depth), depth, np.nan)
    return _metres(_png(data[start:]))


def depth_from_png(data: bytes) -> FloatArray:
    """Depth (rows, columns) [m] of a PNG of 16 bits in millimetres; NaN where it is 0."""
    return _metres(_png(data))


def _png(data: bytes) -> np.ndarray[Any, Any]:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data)) as image:
            levels = np.asarray(image)
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError) as error:
        raise DatasetError(f"a PNG of depth cannot be read ({error}); export it again") from None
    if levels.ndim != 2 or levels.dtype.itemsize < 2:
        raise DatasetError(
            f"a PNG of {levels.shape} values of {8 * levels.dtype.itemsize} bits is no depth "
            "image; expected one channel of 16 bits"
        )
    return levels


def _metres(levels: np.ndarray[Any, Any]) -> FloatArray:
    """Turn whole numbers of millimetres, or metres, into metres; NaN without a measurement."""
    depth = levels.astype(float)
    if levels.dtype.kind in "ui":
        depth *= 1e-3
    with np.errstate(invalid="ignore"):
        depth[~(np.isfinite(depth) & (depth > 0))] = np.nan
    return depth
