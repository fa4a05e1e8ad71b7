"""Counts that tell whether a surface can be filled with elements, and what would mend it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.free_form.triangle_crossings import crossing_pairs
from palpate.setup.surface_repair.surface_topology import SurfaceEdges
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["SurfaceSummary", "flat_triangles", "repeated_triangles", "summarize"]

_FLAT = 1e-9
"""Height over the longest side below which a triangle has no area [1]."""
_SLIVER = 0.02
"""Height over the longest side below which a triangle is a sliver [1]."""


@dataclass(frozen=True, kw_only=True)
class SurfaceSummary:
    """Counts of a surface.

    Attributes:
        triangles: number.
        vertices: number of distinct places.
        repeated_vertices: vertices of the file whose place occurred before.
        collapsed: triangles without an area.
        slivers: triangles whose height is below 2 % of their longest side, collapsed ones left out.
        doubled: triangles between the same three vertices as another one.
        open_edges: edges of one triangle only.
        holes: connected groups of such edges.
        shared_edges: edges of more than two triangles.
        bodies: parts that share no edge.
        flipped: triangles turned against most of their body.
        one_sided: bodies that have one side only, as a Moebius strip.
        crossings: pairs of triangles that cross; None if not counted.
        volume: signed enclosed volume [m^3]; of an open surface without meaning.
        low: lowest coordinates (3,) [m].
        high: highest coordinates (3,) [m].
    """

    triangles: int
    vertices: int
    repeated_vertices: int
    collapsed: int
    slivers: int
    doubled: int
    open_edges: int
    holes: int
    shared_edges: int
    bodies: int
    flipped: int
    one_sided: int
    crossings: int | None
    volume: float
    low: FloatArray
    high: FloatArray

    @property
    def is_closed(self) -> bool:
        """Whether every edge belongs to two triangles."""
        return self.triangles > 0 and not self.open_edges and not self.shared_edges

    @property
    def orientation(self) -> str:
        """Orientation of the triangles in words."""
        if self.one_sided:
            return "none, it has one side only"
        if self.flipped:
            return f"mixed, {self.flipped} against the rest"
        if not self.is_closed:
            return "consistent"
        return "outwards" if self.volume > 0 else "inwards"


def summarize(
    surface: TriangleSurface, repeated_vertices: int = 0, crossings: bool = True
) -> SurfaceSummary:
    """Count what is wrong with a surface.

    Args:
        surface: with merged vertices.
        repeated_vertices: that the file had and that were merged.
        crossings: whether crossing triangles are counted, the slowest part.
    """
    if not len(surface.triangles):
        nothing = np.zeros(3)
        return SurfaceSummary(
            **dict.fromkeys(
                (
                    *("triangles", "collapsed", "slivers", "doubled", "open_edges", "holes"),
                    *("shared_edges", "bodies", "flipped", "one_sided", "crossings"),
                ),
                0,
            ),
            vertices=len(surface.vertices),
            repeated_vertices=repeated_vertices,
            volume=0.0,
            low=nothing,
            high=nothing,
        )
    edges = SurfaceEdges(surface.triangles)
    flipped, one_sided = edges.winding
    collapsed = flat_triangles(surface)
    used = surface.vertices[np.unique(surface.triangles)]
    return SurfaceSummary(
        triangles=len(surface.triangles),
        vertices=len(used),
        repeated_vertices=repeated_vertices,
        collapsed=int(collapsed.sum()),
        slivers=int((flat_triangles(surface, _SLIVER) & ~collapsed).sum()),
        doubled=int(repeated_triangles(surface).sum()),
        open_edges=int((edges.uses == 1).sum()),
        holes=edges.holes,
        shared_edges=int((edges.uses > 2).sum()),
        bodies=int(edges.bodies.max()) + 1,
        flipped=int(flipped.sum()),
        one_sided=int(one_sided.sum()),
        crossings=len(crossing_pairs(surface.vertices, surface.triangles)) if crossings else None,
        volume=surface.volume,
        low=used.min(axis=0),
        high=used.max(axis=0),
    )


def flat_triangles(surface: TriangleSurface, share: float = _FLAT) -> np.ndarray:
    """Mark triangles (t,) whose height is at most a share [1] of their longest side."""
    sides = np.roll(surface.corners, -1, axis=1) - surface.corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    return np.asarray(2 * surface.areas <= share * longest**2)


def repeated_triangles(surface: TriangleSurface) -> np.ndarray:
    """Mark triangles (t,) between the three vertices of an earlier one, in any order."""
    ordered = np.sort(surface.triangles, axis=1)
    order = np.lexsort(ordered.T)
    again = np.zeros(len(ordered), bool)
    again[order[1:]] = (np.diff(ordered[order], axis=0) == 0).all(axis=1)
    return again
