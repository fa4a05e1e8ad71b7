"""The free map of the stiffness as a coloured skin over the body, grey where nothing is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from palpate.app.drawing.coloured_surface import banded_surface
from palpate.app.drawing.figures import Figure
from palpate.app.drawing.surface_bands import FineSurface
from palpate.foundation.arrays import FloatArray

__all__ = ["StiffnessSurface", "stiffness_surface_of"]

_ABOVE = 4e-4
"""Distance of the skin from the body, so that it hides the body's own colour [m]."""
_LEAST = 0.1
"""Smallest change of the logarithm of the stiffness that fills the colour scale [1]."""


@dataclass(frozen=True, eq=False)
class StiffnessSurface:
    """Stiffness below places of the free surface, over the usual one of the body.

    Attributes:
        places: (n, 3) at rest [m].
        values: (n,) logarithm of the ratio; NaN where the data do not tell.
    """

    places: FloatArray
    values: FloatArray

    def figures(
        self, surface: FineSurface, rest: FloatArray, moved: FloatArray, opacity: float
    ) -> dict[str, Figure]:
        """Return the skin over a body: one figure for each colour that occurs.

        Args:
            surface: its fine triangles.
            rest: (v, 3) its coarse vertices at rest [m].
            moved: (v, 3) the same where they are [m].
            opacity: 0 to 1.
        """
        nearest = KDTree(self.places).query(surface.spread(rest))[1]
        vertices = surface.spread(moved)
        limit = max(float(np.nanmax(np.abs(self.values), initial=0.0)), _LEAST)
        return banded_surface(
            "stiffness",
            vertices + _ABOVE * _normals(vertices, surface.faces),
            surface.faces,
            self.values[nearest],
            "error",
            limit,
            opacity,
        )


def stiffness_surface_of(report: dict[str, Any]) -> StiffnessSurface | None:
    """The map of a report; None where it has none, or one that shows only noise."""
    rows = (report.get("stiffness_map") or {}).get("surface") or []
    if not rows:
        return None
    values = [np.log(row["ratio"]) if row["trusted"] else np.nan for row in rows]
    return StiffnessSurface(np.array([row["at"] for row in rows], dtype=float), np.array(values))


def _normals(vertices: FloatArray, faces: Any) -> FloatArray:
    """Outward unit normals (n, 3) at the vertices (n, 3) [m] of triangles."""
    corners = vertices[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], flat)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12))
