"""Closed surfaces from files, and the checks before one is filled with elements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.setup.free_form.triangle_crossings import crossing_pairs
from palpate.setup.free_form.triangle_file import (
    FORMATS,
    check_finite,
    load_triangles,
    merged_vertices,
    remedy,
)

__all__ = ["FORMATS", "check_surface", "read_numbered_surface", "read_surface"]

_FLAT = 1e-9
"""Height of a triangle over its longest side below which it has no area [1]."""
_NEAR = 1e-6
"""Distance up to which corners of triangles that meet are one corner [m]: rounding of a float to
six digits moves them less."""
_SMALLEST, _LARGEST = 1e-3, 2.0
"""Smallest and largest extent of a phantom along any axis [m]: as for a block."""


def read_surface(path: Path, scale: float = 1.0) -> tuple[FloatArray, IntArray]:
    """Read vertices (v, 3) [m] and triangles (t, 3) of a file, without checks.

    Equal vertices are merged into the first of them, so that an STL file's triangles are connected.

    Args:
        path: the file.
        scale: its unit of length [m].
    """
    vertices, triangles, _ = read_numbered_surface(path, scale)
    return vertices, triangles


def read_numbered_surface(path: Path, scale: float = 1.0) -> tuple[FloatArray, IntArray, IntArray]:
    """Read a file like `read_surface`; the third result (n,) is the vertex that each of the file's
    vertices became.
    """
    vertices, triangles = load_triangles(path)
    merged, numbers = merged_vertices(scale * vertices)
    return merged, numbers[triangles], numbers


def check_surface(name: str, vertices: FloatArray, triangles: IntArray) -> None:
    """Raise MeshError if vertices and triangles are not one closed surface that faces outwards.

    Args:
        name: of the file, for messages.
        vertices: (v, 3) [m].
        triangles: (t, 3).
    """
    _check_numbers(name, vertices, triangles)
    _check_size(name, vertices)
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ends, edge, uses = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    _check_closed(name, vertices, ends, uses)
    _check_winding(name, vertices, triangles, directed, edge.ravel())
    _check_crossings(name, vertices, triangles)


def _at(place: FloatArray) -> str:
    """Format a place [m] for a message."""
    return "(" + ", ".join(f"{value:.4f}" for value in place) + ") m"


def _check_numbers(name: str, vertices: FloatArray, triangles: IntArray) -> None:
    if not len(triangles):
        raise MeshError(
            f"{name}: holds no triangle ({len(vertices)} vertices); expected a closed surface: "
            "export it with its faces",
            file=name,
            triangles=0,
        )
    check_finite(name, vertices)
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise MeshError(
            f"{name}: a triangle names vertex {triangles.max()} of {len(vertices)}; export it anew",
            file=name,
        )
    ordered = np.sort(triangles, axis=1)
    flat = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
    if len(flat):
        raise MeshError(
            f"{name}: {len(flat)} of {len(triangles)} triangles have a corner twice, "
            f"the first is number {flat[0]}; expected triangles with an area: remove them, "
            f"{remedy(name, '--clean')}",
            file=name,
            count=len(flat),
            triangle=int(flat[0]),
        )
    sides = vertices[np.roll(triangles, -1, axis=1)] - vertices[triangles]
    across = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    line = np.flatnonzero(across <= _FLAT * np.einsum("tki,tki->tk", sides, sides).max(axis=1))
    if len(line):
        raise MeshError(
            f"{name}: {len(line)} of {len(triangles)} triangles have no area, their corners lie "
            f"on a line, the first is number {line[0]} at {_at(vertices[triangles[line[0], 0]])}; "
            f"expected triangles with an area: remove them, {remedy(name, '--clean')}",
            file=name,
            count=len(line),
            triangle=int(line[0]),
        )


def _check_size(name: str, vertices: FloatArray) -> None:
    size = np.ptp(vertices, axis=0)
    if size.max() <= _LARGEST and size.min() >= _SMALLEST:
        return
    lengths = " x ".join(f"{length:.4g}" for length in size)
    hints = {1e-3: "it is in millimetres", 1e3: "it was scaled from millimetres twice"}
    fitting = [
        scale
        for scale in hints
        if (scale * size).max() <= _LARGEST and (scale * size).min() >= _SMALLEST
    ]
    hint = "correct it"
    if fitting:
        metres = " x ".join(f"{fitting[0] * length:.4g}" for length in size)
        hint = (
            f"if {hints[fitting[0]]}, say so with scale = {fitting[0]:g}, which makes it {metres} m"
        )
    raise MeshError(
        f"{name}: measures {lengths} m along x, y, z; "
        f"expected {_SMALLEST:g} to {_LARGEST:g} m: {hint}",
        file=name,
        size=size.tolist(),
        scale=fitting[0] if fitting else None,
    )


def _check_closed(name: str, vertices: FloatArray, ends: IntArray, uses: IntArray) -> None:
    """Check that every edge belongs to two triangles.

    Args:
        name: of the file.
        vertices: (v, 3) [m].
        ends: (k, 2) vertices of the edges.
        uses: (k,) number of triangles at each edge.
    """
    lone = ends[uses == 1]
    if len(lone):
        graph = sp.coo_matrix(
            (np.ones(len(lone)), (lone[:, 0], lone[:, 1])), shape=(len(vertices), len(vertices))
        )
        hole = connected_components(graph, directed=False)[1][lone[:, 0]]
        names, sizes = np.unique(hole, return_counts=True)
        largest = np.unique(lone[hole == names[np.argmax(sizes)]])
        apart = _split_corners(vertices, lone)
        if apart is not None:
            raise MeshError(
                f"{name}: is open: {len(lone)} of {len(ends)} edges belong to one triangle only, "
                f"since triangles that meet have corners of their own, up to {apart:.1g} m apart; "
                "expected shared corners: merge them, "
                f"{remedy(name, '--clean')}",
                file=name,
                open_edges=len(lone),
                apart=apart,
            )
        raise MeshError(
            f"{name}: is open: {len(lone)} of {len(ends)} edges belong to one triangle only, "
            f"around {len(names)} hole(s), the largest of {sizes.max()} edges at "
            f"{_at(vertices[largest].mean(axis=0))}; expected a closed surface: close it, "
            f"{remedy(name, '--close-base')}, or --fill-holes MM",
            file=name,
            open_edges=len(lone),
            holes=len(names),
            place=vertices[largest].mean(axis=0).tolist(),
        )
    shared = ends[uses > 2]
    if len(shared):
        place = vertices[shared[0]].mean(axis=0)
        raise MeshError(
            f"{name}: {len(shared)} edges belong to more than two triangles, "
            f"the first at {_at(place)}; expected a surface without "
            f"inner walls or doubled triangles: remove them, {remedy(name, '--clean')}, "
            "or --rebuild MM",
            file=name,
            edges=len(shared),
            place=place.tolist(),
        )


def _split_corners(vertices: FloatArray, lone: IntArray) -> float | None:
    """Largest distance [m] of corners on open edges (k, 2) that lie together in pairs; None where
    they do not, as around a hole.
    """
    on = np.unique(lone)
    shortest = float(np.linalg.norm(vertices[lone[:, 0]] - vertices[lone[:, 1]], axis=1).min())
    if shortest < 10 * _NEAR:
        return None
    apart = np.asarray(cKDTree(vertices[on]).query(vertices[on], k=2)[0])[:, 1]
    return float(apart.max()) if (apart <= _NEAR).all() else None


def _check_winding(
    name: str, vertices: FloatArray, triangles: IntArray, directed: IntArray, edge: IntArray
) -> None:
    """Check that the surface is one body whose triangles all face outwards.

    Args:
        name: of the file.
        vertices: (v, 3) [m].
        triangles: (t, 3).
        directed: (3 t, 2) sides of the triangles.
        edge: (3 t,) edge of each side.
    """
    count = len(triangles)
    pairs = np.argsort(edge, kind="stable").reshape(-1, 2)
    first, second = (pairs % count).T
    bodies, body = connected_components(
        sp.coo_matrix((np.ones(len(first)), (first, second)), shape=(count, count)), directed=False
    )
    if bodies > 1:
        sizes = sorted(
            (_volume(vertices, triangles[body == number]) * 1e6 for number in range(bodies)),
            key=abs,
            reverse=True,
        )
        shown = ", ".join(f"{size:.3g}" for size in sizes[:3])
        raise MeshError(
            f"{name}: holds {bodies} separate surfaces (the largest enclose {shown} cm3); "
            "expected one body without cavities: keep one of them, or join them, "
            f"{remedy(name, '--body 1')}, or --rebuild MM",
            file=name,
            bodies=bodies,
        )
    # Each triangle is two nodes of the graph, as it is and turned over. Sides that run the same way
    # join one triangle's front to the other's back.
    turned = (directed[pairs[:, 0], 0] == directed[pairs[:, 1], 0]).astype(int)
    rows = np.concatenate([first, first + count])
    columns = np.concatenate([second + count * turned, second + count * (1 - turned)])
    _, side = connected_components(
        sp.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * count,) * 2), directed=False
    )
    flipped = np.flatnonzero(side[:count] != side[0])
    if len(flipped) > count / 2:
        flipped = np.flatnonzero(side[:count] == side[0])
    if len(flipped):
        place = vertices[triangles[flipped[0]]].mean(axis=0)
        raise MeshError(
            f"{name}: {len(flipped)} of {count} triangles are flipped against the rest, "
            f"the first is number {flipped[0]} at {_at(place)}; "
            "expected all to turn outwards: make the normals consistent, "
            f"{remedy(name, '--orient')}",
            file=name,
            flipped=len(flipped),
            triangle=int(flipped[0]),
            place=place.tolist(),
        )
    volume = _volume(vertices, triangles)
    if volume <= 0:
        raise MeshError(
            f"{name}: all {count} triangles turn inwards (volume {1e6 * volume:.3g} cm3); "
            f"expected outwards: flip the normals, {remedy(name, '--orient')}",
            file=name,
            flipped=count,
            volume=volume,
        )


def _volume(vertices: FloatArray, triangles: IntArray) -> float:
    """Enclosed volume [m^3]; negative if the surface is inside out."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)


def _check_crossings(name: str, vertices: FloatArray, triangles: IntArray) -> None:
    pairs = crossing_pairs(vertices, triangles)
    if len(pairs):
        one, other = (int(number) for number in pairs[0])
        place = vertices[triangles[one]].mean(axis=0)
        raise MeshError(
            f"{name}: {len(pairs)} pairs of triangles cross, the first are numbers {one} and "
            f"{other} "
            f"at {_at(place)}; expected a surface that does not cut itself: repair it there, or "
            f"draw it anew: {remedy(name, '--rebuild MM')}",
            file=name,
            crossings=len(pairs),
            triangles=[one, other],
            place=place.tolist(),
        )
