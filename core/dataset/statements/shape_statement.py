"""Statements about a phantom of any shape: its surface, its upright direction, and what is held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.dataset.statements.checked_keys import Keys, Vector

__all__ = ["SHAPE_KEYS", "ShapeStatement", "read_shape_statement"]

_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""Units of length that a surface's file may have [m]."""
_HELD = ("fixed_surface", "fixed_plane", "fixed_faces", "fixed_vertices")
"""Keys that say what is held in place of `fixed = "base"`."""
_TOLERANCE = 5e-4
"""Distance from what holds the phantom up to which its surface is held, if not stated [m]."""
SHAPE_KEYS = ("surface", "unit", "up", *_HELD, "fixed_tolerance", "holder")
"""Keys of [phantom] that only a phantom of any shape may have."""


@dataclass(frozen=True, kw_only=True)
class ShapeStatement:
    """A surface and what of it is held, in the frame of the surface's file.

    At most one of `fixed_surface`, `fixed_plane`, `fixed_faces`, `fixed_vertices` is given; without
    any, the base is held.

    Attributes:
        surface: name of the file.
        unit: its unit of length [m]; also that of the other surfaces.
        up: unit vector against gravity.
        fixed_surface: file of a second surface, near which the phantom is held.
        fixed_plane: a point [m] and a unit normal; all on the side opposite to the normal is held.
        fixed_faces: numbers of held triangles, in the order of the file.
        fixed_vertices: numbers of vertices; triangles between them are held.
        fixed_tolerance: distance up to which the surface counts as held [m].
        holders: files of rigid things in view that are no phantom.
    """

    surface: str
    unit: float = 1.0
    up: Vector = (0.0, 0.0, 1.0)
    fixed_surface: str = ""
    fixed_plane: tuple[Vector, Vector] | None = None
    fixed_faces: tuple[int, ...] = ()
    fixed_vertices: tuple[int, ...] = ()
    fixed_tolerance: float = _TOLERANCE
    holders: tuple[str, ...] = ()

    @property
    def held_by(self) -> str:
        """The key that says what is held; "fixed" for the base."""
        return next((key for key in _HELD if getattr(self, key)), "fixed")


def read_shape_statement(keys: Keys) -> ShapeStatement:
    """Read the keys of [phantom] that describe a surface."""
    unit = keys.values.get("unit", "m")
    if not isinstance(unit, str) or unit not in _UNITS:
        raise keys.wrong("unit", unit, 'the unit of the surface files, "m", "cm" or "mm"')
    held = [key for key in _HELD if key in keys.values]
    if len(held) > 1:
        raise keys.wrong(held[1], None, f"one statement of what is held; {held[0]} is another one")
    return ShapeStatement(
        surface=keys.name("surface"),
        unit=_UNITS[unit],
        up=_direction(keys, "up") if "up" in keys.values else (0.0, 0.0, 1.0),
        fixed_tolerance=keys.number("fixed_tolerance", 1e-6, 0.05, "m", default=_TOLERANCE),
        holders=_holders(keys),
        **{key: _held(keys, key) for key in held},
    )


def _held(keys: Keys, key: str) -> Any:
    """The value of one of the keys that say what is held."""
    if key == "fixed_surface":
        return keys.name(key)
    if key == "fixed_plane":
        plane = keys.table(key)
        plane.only(("point", "normal"))
        return plane.vector("point", -2.0, 2.0), _direction(plane, "normal")
    numbers = keys.values[key]
    if (
        not isinstance(numbers, list)
        or not numbers
        or any(isinstance(one, bool) or not isinstance(one, int) for one in numbers)
    ):
        raise keys.wrong(key, numbers, "a list of whole numbers, the first triangle or vertex is 0")
    return tuple(numbers)


def _direction(keys: Keys, key: str) -> Vector:
    """A direction as unit vector."""
    x, y, z = keys.vector(key, -1e6, 1e6, unit="")
    length = float(np.sqrt(x * x + y * y + z * z))
    if length < 1e-9:
        raise keys.wrong(key, [x, y, z], "a direction of three numbers, not all of them zero")
    return x / length, y / length, z / length


def _holders(keys: Keys) -> tuple[str, ...]:
    """Files of the rigid things in view, given as one name or as a list."""
    value = keys.values.get("holder", [])
    if isinstance(value, str):
        return (keys.name("holder"),)
    names = keys.names("holder", "surface files")
    return tuple(Keys(keys.prefix, {"holder": name}).name("holder") for name in names)
