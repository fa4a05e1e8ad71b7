"""Phantoms of any shape: the surface from a file, checked, turned upright, with what holds it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.dataset.files import open_inside, problem
from palpate.dataset.statements.shape_statement import ShapeStatement
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.foundation.frames import Transform
from palpate.setup.free_form.fixed_region import Faces, FixedRegion, NearSurface, Painted, Plane
from palpate.setup.free_form.surface_file import FORMATS, read_numbered_surface
from palpate.setup.setup import Shape

__all__ = ["StatedShape", "read_shape"]

_SMALLEST, _LARGEST = 1e-3, 2.0
"""Least and largest extent of a phantom along any axis [m], as for a box."""
_OFF_ORIGIN = 1e-3
"""Height of the lowest point from z = 0 up to which a surface stays where its file puts it [m]."""


@dataclass(frozen=True, eq=False)
class StatedShape:
    """A phantom of any shape, in the phantom frame: z up, the lowest point near z = 0.

    Attributes:
        shape: the body, with the rigid things in view.
        phantom_from_file: to the phantom frame from the frame of the files; the identity if up is z
            and the lowest point lies near z = 0.
    """

    shape: Shape
    phantom_from_file: Transform


def read_shape(root: Path, stated: ShapeStatement) -> StatedShape:
    """Read the body within the surface of a dataset, with what holds it; DatasetError where it
    cannot be meshed.
    """
    file = stated.surface
    vertices, triangles, numbers = _read(root, file, stated.unit)
    if len(triangles) and np.isfinite(vertices).all():
        _check_units(file, vertices, stated.unit)
    turn = _upright(vertices, stated)
    body = turn.apply(vertices)
    in_view = []
    for holder in stated.holders:
        points, faces, _ = _read(root, holder, stated.unit)
        in_view.append((turn.apply(points), faces))
    try:
        fixed = _HELD[stated.held_by](root, stated, turn, body, numbers)
        shape = Shape(body, triangles, fixed, Path(file).name, tuple(in_view))
    except MeshError as error:
        raise problem(file, error.message.removeprefix(f"{Path(file).name}: ")) from error
    return StatedShape(shape, turn)


def _read(root: Path, file: str, unit: float) -> tuple[FloatArray, IntArray, IntArray]:
    """Vertices (v, 3) [m], triangles (t, 3), and the vertex that each one of the file became."""
    open_inside(root, file).close()
    if Path(file).suffix.lower() not in FORMATS:
        raise problem(
            file,
            f"is no surface that can be read; expected one of {', '.join(FORMATS)}: export it as "
            "STL",
        )
    try:
        return read_numbered_surface(root / file, unit)
    except MeshError as error:
        raise problem(file, error.message.removeprefix(f"{Path(file).name}: ")) from error


def _check_units(file: str, vertices: FloatArray, unit: float) -> None:
    """Refuse a surface that is too large or too small for a phantom, with the unit that fits."""
    size = np.ptp(vertices, axis=0)
    shown = " x ".join(f"{length:.4g}" for length in size)
    if size.max() <= _LARGEST and size.min() >= _SMALLEST:
        return
    fits = [
        name
        for name, other in (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3))
        if (size / unit * other).max() <= _LARGEST and (size / unit * other).min() >= _SMALLEST
    ]
    hint = (
        f'it seems to be in {fits[-1]}, export it in metres or state [phantom] unit = "{fits[-1]}"'
        if fits
        else "correct its unit"
    )
    text = f"measures {shown} m along x, y, z; expected {_SMALLEST:g} to {_LARGEST:g} m: {hint}"
    raise problem(file, text, value=shown)


def _upright(vertices: FloatArray, stated: ShapeStatement) -> Transform:
    """The motion that turns up to z and puts the lowest point in z = 0."""
    up, axis = np.array(stated.up), np.array([0.0, 0.0, 1.0])
    if np.allclose(up, axis, atol=1e-6):
        turn = np.eye(3)
    elif np.allclose(up, -axis, atol=1e-6):
        turn = np.diag([1.0, -1.0, -1.0])
    else:
        across = np.cross(up, axis)
        angle = np.arctan2(np.linalg.norm(across), up @ axis)
        turn = Rotation.from_rotvec(angle * across / np.linalg.norm(across)).as_matrix()
    heights = vertices @ turn[2] if len(vertices) else np.zeros(1)
    low = float(heights.min()) if np.isfinite(heights).all() else 0.0
    lift = 0.0 if abs(low) <= _OFF_ORIGIN else -low
    return Transform(turn, np.array([0.0, 0.0, lift]))


def _base(
    root: Path, stated: ShapeStatement, turn: Transform, body: FloatArray, numbers: IntArray
) -> FixedRegion:
    """All within the tolerance of the lowest plane."""
    low = float(body[:, 2].min()) if len(body) else 0.0
    return Plane(height=low, tolerance=stated.fixed_tolerance)


def _near_surface(
    root: Path, stated: ShapeStatement, turn: Transform, body: FloatArray, numbers: IntArray
) -> FixedRegion:
    """All near a second surface."""
    points, faces, _ = _read(root, stated.fixed_surface, stated.unit)
    return NearSurface(
        turn.apply(points), faces, stated.fixed_tolerance, Path(stated.fixed_surface).name
    )


def _behind_plane(
    root: Path, stated: ShapeStatement, turn: Transform, body: FloatArray, numbers: IntArray
) -> FixedRegion:
    """All on the side of a plane that is opposite to its normal."""
    point, normal = stated.fixed_plane or ((0.0,) * 3, (0.0, 0.0, 1.0))
    x, y, z = turn.rotate(np.array(normal))
    height = float(turn.apply(np.array(point)) @ (x, y, z))
    return Plane(height, stated.fixed_tolerance, (float(x), float(y), float(z)))


def _faces(
    root: Path, stated: ShapeStatement, turn: Transform, body: FloatArray, numbers: IntArray
) -> FixedRegion:
    """Triangles by number."""
    return Faces(stated.fixed_faces)


def _painted(
    root: Path, stated: ShapeStatement, turn: Transform, body: FloatArray, numbers: IntArray
) -> FixedRegion:
    """Triangles between painted vertices, which are numbered as in the file."""
    paint = stated.fixed_vertices
    if min(paint) < 0 or max(paint) >= len(numbers):
        raise MeshError(
            f"fixed_vertices names vertex {max(paint)}; expected numbers from 0 to "
            f"{len(numbers) - 1}, in the order of the file"
        )
    return Painted.of(np.unique(numbers[list(paint)]))


_HELD: dict[str, Callable[[Path, ShapeStatement, Transform, FloatArray, IntArray], FixedRegion]] = {
    "fixed": _base,
    "fixed_surface": _near_surface,
    "fixed_plane": _behind_plane,
    "fixed_faces": _faces,
    "fixed_vertices": _painted,
}
"""Reader of what is held, by the key that states it."""
