"""Triangles as they stand in a file: STL, PLY or OBJ."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError

__all__ = [
    "FORMATS",
    "check_finite",
    "load_triangles",
    "merge_vertices",
    "merged_vertices",
    "remedy",
]

FORMATS = (".stl", ".ply", ".obj")
LARGEST_FILE = 2**25
"""Bytes of a surface's file: 600 000 triangles in a binary STL. Reading takes 16 times as much."""
_STL_HEAD, _STL_TRIANGLE = 80, 50
"""Bytes of a binary STL before the number of its triangles, and of each triangle."""


def load_triangles(path: Path, largest: int = LARGEST_FILE) -> tuple[FloatArray, IntArray]:
    """Load vertices (v, 3) and triangles (t, 3) as they stand in a file.

    Raises MeshError for another format, a missing file, one with more bytes than `largest`, or one
    that cannot be read.
    """
    if path.suffix.lower() not in FORMATS:
        raise MeshError(
            f"{path.name}: a surface is read from {', '.join(FORMATS)}, "
            f"not from {path.suffix or 'this'}",
            file=str(path),
        )
    if not path.is_file():
        raise MeshError(
            f"{path.name}: there is no such file in {path.parent}; expected a surface there",
            file=str(path),
        )
    size = path.stat().st_size
    if size > largest:
        smaller = f": {remedy(path.name, '--tolerance MM')}" if size <= 4 * largest else ""
        raise MeshError(
            f"{path.name}: has {size / 2**20:.0f} MiB, at most {largest / 2**20:.0f} are "
            "read: decimate it; meshes for simulation need less than 100 000 triangles" + smaller,
            file=str(path),
            value=size,
            high=largest,
        )
    if path.suffix.lower() == ".stl":
        _check_stl(path, size)
    import trimesh

    try:
        # A texture of 5000 x 5000 pixels would take 2.5 GB.
        loaded = trimesh.load_mesh(path, process=False, maintain_order=True, skip_materials=True)
        vertices, triangles = (
            np.array(loaded.vertices, dtype=float),
            np.array(loaded.faces, dtype=np.int64),
        )
    except Exception as error:  # whatever a reader of three formats meets in a broken file
        raise MeshError(
            f"{path.name}: cannot be read as a surface ({error}); export it anew", file=str(path)
        ) from error
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise MeshError(
            f"{path.name}: a triangle names vertex {triangles.max()}, of {len(vertices)} from 0; "
            "expected a vertex of the file: export it anew",
            file=str(path),
        )
    check_finite(path.name, vertices.reshape(-1, 3))
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def _check_stl(path: Path, size: int) -> None:
    """Check that a file is an STL of text, or a binary one of the length that its head states."""
    with path.open("rb") as file:
        head = file.read(_STL_HEAD + 4)
    if head.lstrip().startswith(b"solid") and b"\0" not in head:
        return
    count = int.from_bytes(head[_STL_HEAD:], "little") if len(head) == _STL_HEAD + 4 else 0
    expected = _STL_HEAD + 4 + _STL_TRIANGLE * count
    if len(head) < _STL_HEAD + 4 or size != expected:
        told = f"a binary STL of {count} triangles has {expected}" if count else "no STL begins so"
        raise MeshError(
            f"{path.name}: cannot be read as a surface: the file has {size} bytes, {told}; it was "
            "cut off or is something else: export it anew",
            file=str(path),
            value=size,
            expected=expected,
        )


def merge_vertices(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge equal vertices, in the order of their first appearance."""
    merged, numbers = merged_vertices(vertices)
    return merged, numbers[triangles]


def merged_vertices(vertices: FloatArray) -> tuple[FloatArray, IntArray]:
    """Different vertices in the order of their first appearance, and the number (n,) of each of the
    given ones.
    """
    order = np.lexsort(vertices.T)
    new = np.ones(len(order), bool)
    new[1:] = (vertices[order[1:]] != vertices[order[:-1]]).any(axis=1)
    # lexsort is stable, so that the first of equal vertices comes first.
    first = np.empty_like(order)
    first[order] = order[new][np.cumsum(new) - 1]
    kept = first == np.arange(len(order))
    return vertices[kept], (np.cumsum(kept) - 1)[first]


def remedy(name: str, options: str) -> str:
    """Sentence on the command that repairs a file."""
    return f"`palpate surface {name} {options} --out FILE` does it"


def check_finite(name: str, vertices: FloatArray) -> None:
    """Raise MeshError unless all vertices (v, 3) are finite."""
    broken = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(broken):
        raise MeshError(
            f"{name}: {len(broken)} of {len(vertices)} vertices are not finite, "
            f"the first is number {broken[0]}: {vertices[broken[0]].tolist()}; expected metres: "
            "export it anew",
            file=name,
            count=len(broken),
            vertex=int(broken[0]),
        )
