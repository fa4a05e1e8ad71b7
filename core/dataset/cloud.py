"""Strict reader for point clouds as PLY.

Usual readers return an empty or shortened cloud for a broken file. Files may be binary of either
byte order or ascii; x, y, z are float or double among any other vertex properties.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from palpate.dataset.csv_table import LARGEST_COORDINATE, check_coordinates
from palpate.dataset.files import open_inside, problem
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = ["PlyHeader", "read_cloud", "read_header", "read_points"]

_LARGEST_HEADER = 2**14
_MOST_POINTS = 6_000_000
"""Of one cloud: depth cameras give up to five million."""
_MOST_BYTES = 2**28
"""Largest size of a file [bytes]; six million points as text take less."""
_MOST_FAR = 0.1
"""Largest share of points beyond the farthest plausible place that are left out [1]; of more, the
unit is wrong."""
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
_BARE = tuple(tuple((axis, kind) for axis in "xyz") for kind in ("f4", "f8"))
_Order = Literal["<", ">", "="]


@dataclass(frozen=True)
class PlyHeader:
    """Layout of the points in a PLY file.

    Attributes:
        count: number of points.
        order: byte order as in NumPy; "=" stands for ascii.
        fields: (name, type) of each vertex property.
        start: offset of the first point [bytes].
    """

    count: int
    order: _Order
    fields: tuple[tuple[str, str], ...]
    start: int

    @property
    def layout(self) -> np.dtype[Any]:
        """NumPy type of the packed record of one point."""
        return np.dtype([(name, self.order + kind) for name, kind in self.fields])


@dataclass
class _Element:
    name: str
    count: int
    fields: list[tuple[str, str]]
    has_list: bool = False

    @property
    def record(self) -> int:
        return sum(int(kind[1]) for _, kind in self.fields)


def read_header(root: Path, file: str, within: str = "") -> PlyHeader:
    """Read the header of a cloud and check it against the size of the file."""
    with open_inside(root, file, within) as stream:
        return _header(
            file, _read(file, stream, _LARGEST_HEADER), os.fstat(stream.fileno()).st_size
        )


def read_cloud(root: Path, file: str, within: str = "") -> FloatArray:
    """Read the points (n, 3) [m], n >= 1, camera frame; DatasetError unless all are finite and
    plausible.

    Few points beyond 10 m are left out: a camera marks depths that it could not measure by its
    largest number, 65.535 m where it counts millimetres in 16 bits.
    """
    points = read_points(root, file, within)
    # Measured: a tenth of the time of the tests of each point, which find what is wrong.
    if np.abs(points).max() <= LARGEST_COORDINATE:
        return points
    far = np.isfinite(points).all(axis=1) & (np.abs(points) > LARGEST_COORDINATE).any(axis=1)
    if 0 < far.sum() <= _MOST_FAR * len(points):
        points = points[~far]
    check_coordinates(file, points, first_row=1)
    return points


def read_points(root: Path, file: str, within: str = "") -> FloatArray:
    """Read the points (n, 3), n >= 1, whatever their values; DatasetError for a damaged file."""
    with open_inside(root, file, within) as stream:
        size = os.fstat(stream.fileno()).st_size
        header = _header(file, _read(file, stream, _LARGEST_HEADER), size)
        stream.seek(header.start)
        length = (
            size - header.start if header.order == "=" else header.count * header.layout.itemsize
        )
        data = _read(file, stream, length)
    return (
        _ascii_points(file, header, data)
        if header.order == "="
        else _binary_points(file, header, data)
    )


def _read(file: str, stream: Any, length: int) -> bytes:
    try:
        return bytes(stream.read(length))
    except OSError as error:
        raise problem(
            file, f"cannot be read ({error.strerror}); check the disk and copy the file again"
        ) from error


def _header(file: str, data: bytes, size: int) -> PlyHeader:
    text, start = _header_text(file, data)
    order, elements = _elements(file, text)
    skipped = 0
    for index, element in enumerate(elements):
        if element.name == "vertex":
            _check_vertex(file, element)
            header = PlyHeader(element.count, order, tuple(element.fields), start + skipped)
            _check_size(file, header, size, elements[index + 1 :])
            return header
        if element.has_list or (order == "=" and element.count):
            raise problem(
                file,
                f"element {element.name} comes before the points; expected vertex first: write it "
                "first",
            )
        skipped += element.count * element.record
    raise problem(
        file,
        "has no element vertex; expected the points there: export the cloud as a PLY of vertices",
        key="vertex",
    )


def _header_text(file: str, data: bytes) -> tuple[list[str], int]:
    if not data.startswith((b"ply\n", b"ply\r\n")):
        found = "is empty" if not data else f"starts with {data[:8]!r}"
        raise problem(
            file,
            f"{found}; expected a PLY file ('ply' in its first line): export the cloud again as "
            "PLY",
            row=1,
        )
    newline = b"\r\n" if data.startswith(b"ply\r\n") else b"\n"
    end = data.find(newline + b"end_header" + newline)
    if end < 0:
        raise problem(
            file,
            "has no end_header line; expected a whole PLY header: the file is cut off or "
            "damaged, export it again",
        )
    # A comment may hold any characters; Latin-1 decodes every byte.
    lines = data[:end].decode("latin-1").split(newline.decode())
    if not all(line.isascii() or line.startswith(("comment", "obj_info")) for line in lines):
        raise problem(
            file,
            "has more than plain characters in its header; expected ASCII there: export it again",
        )
    return lines, end + len(newline) * 2 + len(b"end_header")


def _elements(file: str, lines: list[str]) -> tuple[_Order, list[_Element]]:
    order: _Order | None = None
    elements: list[_Element] = []
    for row, line in enumerate(lines[1:], 2):
        try:
            match line.split():
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case ["format", name, "1.0"] if name in _ORDERS and order is None:
                    order = _ORDERS[name]  # type: ignore[assignment]
                case ["element", name, count] if _is_count(count) and name not in (
                    element.name for element in elements
                ):
                    elements.append(_Element(name, int(count), []))
                case ["property", "list", _, _, _] if elements:
                    elements[-1].has_list = True
                case ["property", kind, name] if elements and name not in dict(elements[-1].fields):
                    elements[-1].fields.append((name, _TYPES[kind]))
                case _:
                    raise KeyError(line)
        except KeyError:
            text = (
                f"'{line[:60]}' is no line of a PLY 1.0 header, or comes twice; export the "
                "cloud again"
            )
            raise problem(file, text, row=row, value=line[:60]) from None
    if order is None:
        raise problem(
            file,
            f"has no format line; expected one of {', '.join(_ORDERS)}: export the cloud again",
            row=2,
            key="format",
        )
    return order, elements


def _is_count(text: str) -> bool:
    return re.fullmatch(r"\d{1,18}", text, re.ASCII) is not None


def _check_vertex(file: str, element: _Element) -> None:
    kinds = dict(element.fields)
    for axis in "xyz":
        if kinds.get(axis) not in ("f4", "f8"):
            found = (
                f"has no vertex property {axis}" if axis not in kinds else f"{axis} is an integer"
            )
            raise problem(
                file,
                f"{found}; expected float or double x, y, z in metres: export the cloud again",
                key=axis,
            )
    if element.has_list:
        raise problem(
            file,
            "a point has a list property; expected numbers only: export the cloud without it",
            key="vertex",
        )
    if element.count == 0:
        raise problem(
            file,
            "is an empty cloud (element vertex 0); expected points: leave this frame out",
            key="vertex",
            value=0,
        )


def _check_size(file: str, header: PlyHeader, size: int, rest: list[_Element]) -> None:
    # In ascii, a number and its separator take at least two characters.
    record = 2 * len(header.fields) if header.order == "=" else header.layout.itemsize
    present = size - header.start + (1 if header.order == "=" else 0)
    if present < header.count * record:
        text = (
            f"element vertex announces {header.count} points ({header.count * record} bytes) but "
            f"{max(present, 0)} bytes follow; "
            "expected all of them: the file is cut off, export or copy it again"
        )
        raise problem(file, text, key="vertex", value=header.count)
    _check_limits(file, header, size)
    if header.order == "=" or any(element.has_list for element in rest):
        return
    expected = header.count * record + sum(element.count * element.record for element in rest)
    if present != expected:
        text = (
            f"element vertex and what follows take {expected} bytes by the header, {present} "
            "are there; export or copy it again"
        )
        raise problem(file, text, key="vertex", value=header.count)


def _check_limits(file: str, header: PlyHeader, size: int) -> None:
    if header.count > _MOST_POINTS:
        text = f"has {header.count} points; expected at most {_MOST_POINTS}: thin the cloud"
        raise problem(file, text, key="vertex", value=header.count)
    if size > _MOST_BYTES:
        text = (
            f"has {size / 2**20:.0f} MiB; expected at most {_MOST_BYTES // 2**20}: leave out what "
            "is not x, y, z, or thin the cloud"
        )
        raise problem(file, text, value=size)


def _binary_points(file: str, header: PlyHeader, data: bytes) -> FloatArray:
    records = np.frombuffer(data, dtype=header.layout, count=header.count)
    points = np.empty((header.count, 3))
    with np.errstate(invalid="ignore"):  # a signalling NaN is rejected later
        if header.fields in _BARE:
            points[:] = records.view(header.layout["x"]).reshape(-1, 3)
        else:
            for axis, name in enumerate("xyz"):
                points[:, axis] = records[name]
    return points


def _ascii_points(file: str, header: PlyHeader, data: bytes) -> FloatArray:
    lines = data.split(b"\n", header.count)[: header.count]
    names = [name for name, _ in header.fields]
    columns = [names.index(axis) for axis in "xyz"]
    points = np.empty((header.count, 3))
    if len(lines) < header.count:
        raise _short(file, header, len(lines))
    for row, line in enumerate(lines):
        cells = line.split()
        if not cells and row == len(lines) - 1:
            raise _short(file, header, row)
        if len(cells) != len(names):
            text = (
                f"{len(cells)} numbers; expected {len(names)} ({' '.join(names)}): export the "
                "cloud again"
            )
            raise problem(file, text, row=row + 1)
        try:
            points[row] = [float(cells[column]) for column in columns]
        except ValueError:
            found = line[:40].decode("ascii", "replace")
            raise problem(
                file, f"'{found}' are not numbers; export the cloud again", row=row + 1, value=found
            ) from None
    return points


def _short(file: str, header: PlyHeader, found: int) -> DatasetError:
    text = (
        f"element vertex announces {header.count} points, {found} follow; the file is cut "
        "off, export or copy it again"
    )
    return problem(file, text, row=found + 1, key="vertex", value=header.count)
