"""A step that takes as few triangles as a tolerance allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import IntArray
from palpate.setup.surface_repair.surface_deviation import surface_deviation
from palpate.setup.surface_repair.surface_summary import SurfaceSummary, summarize
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["Decimate"]

_FEWEST = 200
"""Triangles below which none are removed."""
_FINEST_RATIO = 1.15
"""Ratio of the triangles of two attempts below which no other is made between them [1]."""


@dataclass(frozen=True)
class Decimate:
    """Collapse edges by quadric errors (Garland and Heckbert 1997, in Open3D) while no point of
    either surface is farther than a tolerance from the other.

    A result that is open where the surface was closed, or that crosses itself, is not taken.

    Attributes:
        tolerance: [m].
    """

    tolerance: float
    title = "decimate"
    unmoved = ""

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Decimate the surface."""
        before = summarize(surface, crossings=False)
        for tried in reversed(self._within(surface)):
            if _serves(before, tried):
                return tried, (
                    f"{len(surface.triangles)} to {len(tried.triangles)} triangles within "
                    f"{1e3 * self.tolerance:g} mm"
                )
        return surface, (
            f"kept all {len(surface.triangles)} triangles: with fewer the surface deviates by more "
            f"than {1e3 * self.tolerance:g} mm, or crosses itself"
        )

    def _within(self, surface: TriangleSurface) -> list[TriangleSurface]:
        """Surfaces within the tolerance, each with fewer triangles than the one before."""
        kept, too_few = [surface], 0
        target = len(surface.triangles) // 2
        while target >= _FEWEST and target > _FINEST_RATIO * too_few:
            # Each attempt starts from the last that was near enough: a large one takes one pass.
            tried = _fewer(kept[-1], target)
            count = len(tried.triangles)
            if (
                count < len(kept[-1].triangles)
                and surface_deviation(surface, tried).largest <= self.tolerance
            ):
                kept.append(tried)
            else:
                too_few = max(target, count)
            last = len(kept[-1].triangles)
            target = max(last // 2, int(np.sqrt(too_few * float(last))))
            if _FINEST_RATIO * target > last:
                break
        return kept[1:]


def _serves(before: SurfaceSummary, tried: TriangleSurface) -> bool:
    """Whether a surface is as closed as the one before, and crosses itself nowhere."""
    after = summarize(tried)
    return (
        after.is_closed >= before.is_closed
        and after.bodies == before.bodies
        and after.flipped <= before.flipped
        and not after.collapsed
        and not after.crossings
    )


def _fewer(surface: TriangleSurface, count: int) -> TriangleSurface:
    """About so many triangles, by Open3D."""
    import open3d as o3d

    # Open3D's quadrics use absolute tolerances made for bodies of size one.
    middle, span = surface.vertices.mean(axis=0), float(np.ptp(surface.vertices, axis=0).max())
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector((surface.vertices - middle) / span),
        o3d.utility.Vector3iVector(surface.triangles.astype(np.int32)),
    ).simplify_quadric_decimation(count)
    triangles: IntArray = np.asarray(mesh.triangles).astype(np.int64)
    return surface.of(triangles, middle + span * np.asarray(mesh.vertices))
