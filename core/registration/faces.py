"""Planes to which a rest cloud is registered: the block's top, visible sides, and the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from palpate.foundation.arrays import FloatArray, lengths
from palpate.setup.box import Box

IndexArray = np.ndarray[Any, np.dtype[np.int64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

__all__ = [
    "CELL",
    "EDGE",
    "FACES",
    "GRAZING",
    "NORMALS",
    "SIDE_OFFSET",
    "TABLE_REACH",
    "Assignment",
    "Planes",
    "assign",
    "box_distance",
    "camera_planes",
    "joined",
]

FACES = ("top", "-x", "+x", "-y", "+y", "table")
"""Names of the planes."""
NORMALS = np.array(
    [[0, 0, 1], [-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1]], dtype=float
)
SIDE_OFFSET = 0.3
"""Bulge of the sides over the sag of the top [1], about Poisson's ratio times width over height."""
SAGS = np.array([1.0, *[SIDE_OFFSET] * 4, 0.0])
"""Offset of each plane where the top sags by one [1]; the table has none."""
CELL = 8.0e-3
"""Edge length of the cells in which points are averaged [m]."""
EDGE = 2.0e-3
"""Distance to an edge below which points are left out [m]: noise moves them across it, and a real
edge is round."""
TABLE_REACH = 0.08
"""Distance from the block up to which points of the table are used [m]."""
GRAZING = 0.2
"""Least cosine between normal and line of sight that is used [1]."""


@dataclass(frozen=True, eq=False)
class Planes:
    """The six planes n.x = d of a block on its table.

    Attributes:
        size: (3,) of the block [m].
        offsets: (6,) d [m]; the normals are NORMALS.
        visible: (6,) bool, planes whose front the camera sees.
    """

    size: FloatArray
    offsets: FloatArray
    visible: Mask


@dataclass(frozen=True, eq=False)
class Assignment:
    """Points that lie on a stated surface, phantom frame.

    Attributes:
        rows: (k,) rows of the cloud.
        face: (k,) part of the surface that may be offset as a whole; of a block, index into FACES.
        points: (k, 3) where their rays meet the surface [m]: free of noise, which lies along rays.
        normals: (k, 3) of the surface, unit vectors.
        distance: (k,) signed distance [m], positive outside.
        slant: (k,) cosine between normal and line of sight [1], at least GRAZING; the part of depth
            noise in `distance`.
        cell: (k, 3) cells of about 8 mm, whose points are averaged.
        sag: (k,) distance that a soft body loses there where its top sags by one [1].
    """

    rows: IndexArray
    face: IndexArray
    points: FloatArray
    normals: FloatArray
    distance: FloatArray
    slant: FloatArray
    cell: IndexArray
    sag: FloatArray

    def only(self, keep: Mask) -> Self:
        """The points for which `keep` (k,) is true."""
        return replace(
            self, **{field.name: getattr(self, field.name)[keep] for field in fields(self)}
        )


def joined(parts: Sequence[Assignment]) -> Assignment:
    """The points of several assignments of one cloud."""
    return Assignment(
        **{
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(Assignment)
        }
    )


def camera_planes(size: tuple[float, float, float], camera: FloatArray) -> Planes:
    """The planes of a block of `size` [m] for a camera at (3,) [m], phantom frame."""
    x, y, z = size
    offsets = np.array([z, x / 2, x / 2, y / 2, y / 2, 0.0])
    before = NORMALS @ camera - offsets
    return Planes(np.asarray(size), offsets, before > 0.1 * np.linalg.norm(camera))


def assign(points: FloatArray, planes: Planes, camera: FloatArray, gate: float) -> Assignment:
    """Assign points (n, 3) [m], phantom frame, to the nearest plane within `gate` [m]; points near
    edges and others are left out.
    """
    half = planes.size[:2] / 2
    distance = points @ NORMALS.T - planes.offsets
    across = np.abs(points[:, :2]) - half
    in_height = (points[:, 2] > EDGE) & (points[:, 2] < planes.size[2] - EDGE)
    over_base = (across < -EDGE).all(axis=1)
    beside = across.max(axis=1)
    inside = np.empty((len(points), 6), dtype=bool)
    inside[:, 0] = over_base
    inside[:, 1:3] = (in_height & (across[:, 1] < -EDGE))[:, None]
    inside[:, 3:5] = (in_height & (across[:, 0] < -EDGE))[:, None]
    inside[:, 5] = (beside > 2 * EDGE) & (beside < TABLE_REACH)
    far = np.where(inside & planes.visible, np.abs(distance), np.inf)
    face = far.argmin(axis=1)
    rows = np.flatnonzero(far[np.arange(len(points)), face] < gate)
    face, near = face[rows], points[rows]
    sight = near - camera
    sight /= lengths(sight)[:, None]
    slope = np.einsum("ki,ki->k", sight, NORMALS[face])
    slant = np.maximum(np.abs(slope), GRAZING)
    feet = near + sight * (distance[rows, face] / slant)[:, None]
    found = Assignment(
        rows=rows,
        face=face,
        points=feet,
        normals=NORMALS[face],
        distance=distance[rows, face],
        slant=slant,
        cell=_cells(feet, face),
        sag=SAGS[face],
    )
    return found.only(_populated(found, planes)[found.face])


def _cells(points: FloatArray, face: IndexArray) -> IndexArray:
    """Cells (k, 3) of points (k, 3) [m] on faces (k,), flat across each face."""
    sizes = np.where(face == FACES.index("table"), 1.5 * CELL, CELL)
    cells = np.floor((points + EDGE) / sizes[:, None]).astype(np.int64)
    cells[np.arange(len(points)), np.abs(NORMALS[face]).argmax(axis=1)] = 0
    return cells


def _populated(found: Assignment, planes: Planes) -> Mask:
    """Mask (6,) of faces with a plausible number of points; a few stray points make no side."""
    x, y, z = planes.size
    areas = np.array([x * y, y * z, y * z, x * z, x * z, np.inf])
    seen = np.bincount(found.face, weights=1 / found.slant, minlength=6)
    seen[5] = 0.0
    counts = np.bincount(found.face, minlength=6)
    return np.asarray(
        (counts >= 20) & ((seen / areas > 0.1 * (seen / areas).max()) | (np.arange(6) == 5))
    )


def box_distance(points: FloatArray, size: tuple[float, float, float]) -> FloatArray:
    """Signed distance (n,) [m] of points (n, 3), phantom frame, to the surface of the block,
    positive outside.
    """
    return Box(size=size).outside(points)
