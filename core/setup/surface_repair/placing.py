"""Steps that turn triangles outwards, the body upright, and put it on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.setup.surface_repair.surface_topology import SurfaceEdges
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["Orient", "PutOnTable", "TurnUp", "read_direction"]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Orient:
    """Turn all triangles of a body the same way, and outwards where it is closed."""

    title = "orient"
    unmoved = "nothing moved"

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Orient the triangles; MeshError for a surface of one side."""
        edges = SurfaceEdges(surface.triangles)
        flipped, one_sided = edges.winding
        if one_sided.any():
            raise MeshError(
                f"{surface.name}: {one_sided.sum()} of its bodies have one side only, so that "
                "nothing is outside; rebuild the surface with --rebuild MM",
                file=surface.name,
            )
        turned = flipped.copy()
        for body in range(int(edges.bodies.max(initial=-1)) + 1):
            own = edges.bodies == body
            if _signed_volume(surface, own, turned) < 0:
                turned[own] = ~turned[own]
        triangles = surface.triangles.copy()
        triangles[turned] = triangles[turned][:, ::-1]
        return surface.of(triangles), f"turned {turned.sum()} of {len(turned)} triangles"


def _signed_volume(surface: TriangleSurface, own: np.ndarray, turned: np.ndarray) -> float:
    """Volume [m^3] between a body's triangles and the middle of its rim, or of its vertices."""
    triangles = np.where(turned[own, None], surface.triangles[own][:, ::-1], surface.triangles[own])
    rim = SurfaceEdges(triangles).lone
    around = np.unique(rim if len(rim) else triangles)
    a, b, c = (surface.vertices[triangles] - surface.vertices[around].mean(axis=0)).transpose(
        1, 0, 2
    )
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)


def read_direction(text: str) -> FloatArray:
    """Read a unit vector (3,): x, y, z, -x, -y, -z, or three numbers with commas; MeshError for
    anything else.
    """
    sign, name = (-1.0, text[1:]) if text.startswith("-") else (1.0, text)
    if name in _AXES:
        return sign * np.array(_AXES[name])
    try:
        vector = np.array([float(part) for part in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise MeshError(
            f"up is {text!r}; expected x, y, z, -x, -y, -z, or three numbers such as 0,0.1,1",
            up=text,
        )
    return np.asarray(vector / np.linalg.norm(vector))


@dataclass(frozen=True)
class TurnUp:
    """Turn the body so that a direction of the file becomes z.

    Attributes:
        up: as `read_direction` takes it.
    """

    up: str
    title = "up"
    unmoved = "moved as a whole"

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Turn the body by the smallest rotation; by half a turn around x from -z."""
        way = read_direction(self.up)
        turn = _onto_z(way)
        angle = np.degrees(np.arccos(np.clip(way[2], -1.0, 1.0)))
        turned = TriangleSurface(surface.vertices @ turn.T, surface.triangles, surface.name)
        rows = "; ".join(" ".join(f"{value:.4g}" for value in row) for row in turn + 0.0)
        return turned, f"turned by {angle:.4g} degrees, {self.up} became z: rotation [{rows}]"


def _onto_z(way: FloatArray) -> FloatArray:
    """Rotation (3, 3) of a unit vector onto z (Rodrigues)."""
    if way[2] < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, y, z = way
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + z))


@dataclass(frozen=True)
class PutOnTable:
    """Move the body along z so that its lowest point lies at z = 0."""

    title = "on table"
    unmoved = "moved as a whole"

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Move the body."""
        low = float(surface.vertices[:, 2].min())
        moved = surface.vertices - (0.0, 0.0, low)
        return TriangleSurface(moved, surface.triangles, surface.name), (
            f"moved by {-1e3 * low:.4g} mm along z; landmarks on it move with it"
        )
