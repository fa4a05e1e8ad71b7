"""Repair of a surface step by step, each measured against the surface before it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.foundation.errors import MeshError
from palpate.foundation.progress import Report, silent
from palpate.setup.free_form.triangle_file import load_triangles, merge_vertices
from palpate.setup.surface_repair.surface_deviation import SurfaceDeviation, surface_deviation
from palpate.setup.surface_repair.surface_summary import SurfaceSummary
from palpate.setup.surface_repair.triangle_surface import RepairStep, TriangleSurface

__all__ = [
    "LARGEST_FILE",
    "UNITS",
    "RepairRecord",
    "load_surface",
    "remedies",
    "repair",
    "rounded",
    "write_stl",
]

LARGEST_FILE = 2**27
"""Bytes of a file that is read to be repaired: 2.6 million triangles in a binary STL."""
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""Units of length of a file [m]."""
_ON_TABLE = 2e-3
"""Largest height of the lowest point from z = 0 [m], as the reader of datasets has it."""


@dataclass(frozen=True)
class RepairRecord:
    """One step of a repair.

    Attributes:
        title: of the step.
        said: description of the change, with numbers.
        unmoved: reason why no deviation was measured; empty where one was.
        deviation: of the new surface from the old one; None where none was measured.
    """

    title: str
    said: str
    unmoved: str
    deviation: SurfaceDeviation | None


def load_surface(path: Path, unit: str) -> tuple[TriangleSurface, int]:
    """Load a surface in metres and count the vertices whose place occurred before, which are
    merged.

    Raises MeshError for a file that cannot be read, is larger than LARGEST_FILE, or holds no
    triangles or places that are not finite.

    Args:
        path: an STL, PLY or OBJ.
        unit: of its coordinates, one of UNITS.
    """
    vertices, triangles = load_triangles(path, LARGEST_FILE)
    if not len(triangles):
        raise MeshError(
            f"{path.name}: holds no triangle ({len(vertices)} vertices); expected a surface: "
            "export it with its faces",
            file=path.name,
        )
    places, merged = merge_vertices(UNITS[unit] * vertices, triangles)
    surface = TriangleSurface(places, merged, path.name)
    return surface, len(vertices) - len(places)


def repair(
    surface: TriangleSurface, steps: Sequence[RepairStep], report: Report = silent
) -> tuple[TriangleSurface, list[RepairRecord]]:
    """Pass a surface through steps; MeshError where one is impossible or leaves nothing."""
    records = []
    for number, step in enumerate(steps):
        report(number / len(steps), step.title)
        changed, said = step(surface)
        if not len(changed.triangles):
            raise MeshError(
                f"{surface.name}: {step.title} left no triangle ({said}); leave this step out",
                file=surface.name,
            )
        deviation = None if step.unmoved else surface_deviation(surface, changed)
        records.append(RepairRecord(step.title, said, step.unmoved, deviation))
        surface = changed
    return surface, records


def remedies(found: SurfaceSummary) -> list[str]:
    """Options of `palpate surface` that mend what a summary shows, in the order of the steps."""
    broad = found.open_edges > 0
    options = [
        (found.collapsed or found.doubled or found.shared_edges, "--clean"),
        (found.bodies > 1, "--body 1"),
        (found.flipped or (found.is_closed and found.volume < 0), "--orient"),
        (broad, "--close-base"),
        (found.holes > 1, "--fill-holes MM"),
        (found.crossings or found.one_sided, "--rebuild MM"),
        (abs(float(found.low[2])) > _ON_TABLE, "--on-table"),
    ]
    return [option for needed, option in options if needed]


def rounded(surface: TriangleSurface) -> TriangleSurface:
    """The surface as a binary STL keeps it, in single precision."""
    vertices, triangles = merge_vertices(
        surface.vertices.astype(np.float32).astype(float), surface.triangles
    )
    return TriangleSurface(vertices, triangles, surface.name)


def write_stl(surface: TriangleSurface, path: Path) -> None:
    """Write a binary STL, metres; the file appears whole or not at all."""
    import trimesh

    aside = path.with_name(f".{path.name}.part")
    try:
        trimesh.Trimesh(surface.vertices, surface.triangles, process=False).export(
            aside, file_type="stl"
        )
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)
