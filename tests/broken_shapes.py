"""The ways in which the surface of a dataset is broken, most often by a scanner or an export.

`write_shape(folder)` writes a whole dataset of a shape, `SHAPE_BREAKAGES[name](folder)` breaks it
in one way. Its `.where` and `.says` are what the error has to tell.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from breakage import Breakage, change, make_folder, remove, replace, write
from shapes import box_surface, write_felt_shape

__all__ = ["SHAPE_BREAKAGES", "write_shape"]

_TOML, _STL = "dataset.toml", "phantom.stl"
_SIZE = (0.06, 0.04, 0.03)
_CAMERA = '[camera]\nname = "made up"\ndepth_sigma = 0.001\nto_phantom = {}\n[splits]'
_Arrays = tuple[np.ndarray, np.ndarray]


def write_shape(folder: Path) -> Path:
    """Write a dataset of a block given as a surface of twelve triangles."""
    folder.mkdir()
    return write_felt_shape(folder, *box_surface(_SIZE))


def _surface(by: Callable[[np.ndarray, np.ndarray], _Arrays]) -> Callable[[Path], object]:
    """Write another surface, made from the vertices [m] and triangles of the whole one."""

    def breaks(folder: Path) -> None:
        vertices, triangles = by(*box_surface(_SIZE))
        with np.errstate(invalid="ignore"):  # normals at infinity
            trimesh.Trimesh(vertices, triangles, process=False).export(folder / _STL)

    return breaks


def _scaled(factor: float) -> Callable[[Path], object]:
    return _surface(lambda v, t: (factor * v, t))


def _with_nan(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    vertices[3, 1] = np.nan
    return vertices, triangles


def _mixed(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    triangles[[2, 7]] = triangles[[2, 7]][:, ::-1]
    return vertices, triangles


def _joined(move: tuple[float, float, float], size: tuple[float, float, float]):
    """Add another block, moved [m]."""

    def both(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
        other, more = box_surface(size)
        return (
            np.concatenate([vertices, other + move]),
            np.concatenate([triangles, more + len(vertices)]),
        )

    return both


def _spiked(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    ball = trimesh.creation.icosphere(2, 0.02)
    places = np.array(ball.vertices) + np.array([0.0, 0.0, 0.02])
    places[places[:, 2].argmax(), 2] = 0.001  # from the top down almost to the bottom
    places[places[:, 2].argmin(), 2] = 0.012
    places[:, 2] -= places[:, 2].min()
    return places, np.array(ball.faces)


def _line(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    """Put a vertex on an edge of one triangle only, and a triangle without an area beside it."""
    a, b, c = triangles[0]
    count = len(vertices)
    split = np.concatenate([vertices, [0.5 * (vertices[a] + vertices[b])]])
    return split, np.concatenate([triangles[1:], [(a, count, c), (count, b, c), (a, b, count)]])


def _without_base(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    return vertices, triangles[~(vertices[triangles, 2] < 1e-9).all(axis=1)]


def _no_base(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    """Stand the block on one of its corners: no triangle lies low."""
    lean = trimesh.transformations.euler_matrix(0.7, 0.6, 0.0)[:3, :3]
    stood = vertices @ lean.T
    return stood - (0.0, 0.0, stood[:, 2].min()), triangles


def _alone(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    return np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.04, 0.03]]), np.array([[0, 1, 2]])


def _flat(vertices: np.ndarray, triangles: np.ndarray) -> _Arrays:
    return vertices * (1.0, 1.0, 0.01), triangles


def _named(name: str, content: bytes | str) -> Callable[[Path], None]:
    """Name another file as the surface, with this content."""

    def breaks(folder: Path) -> None:
        replace(_TOML, "phantom.stl", name)(folder)
        write(name, content)(folder)

    return breaks


def _huge(folder: Path) -> None:
    with (folder / _STL).open("wb") as file:
        file.truncate(2**25 + 1)


def _linked(folder: Path) -> None:
    outside = folder.parent / "outside.stl"
    (folder / _STL).rename(outside)
    (folder / _STL).symlink_to(outside)


_PLY = (
    "ply\nformat ascii 1.0\nelement vertex {}\n"
    "property float x\nproperty float y\nproperty float z\n"
)
_POINTS = _PLY.format(4) + "end_header\n0 0 0\n0.05 0 0\n0 0.05 0\n0 0 0.05\n"
_BEYOND = (
    _PLY.format(3)
    + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    + "0 0 0\n0.05 0 0\n0 0.05 0.03\n3 0 1 7\n"
)
_FOOT = ((0, 0), (0.05, 0), (0.05, 0.04), (0, 0.04))
_OPEN_QUADS = (
    "".join(f"v {x} {y} {z}\n" for z in (0, 0.03) for x, y in _FOOT)
    + "f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
)


def _one(breaks: Callable[[Path], object], *says: str, file: str = _STL) -> Breakage:
    return Breakage(breaks, {"file": file}, says)


def _pose(rows: str, *says: str) -> Breakage:
    """State a pose of the camera."""
    return Breakage(
        replace(_TOML, "[splits]", _CAMERA.format(rows)),
        {"file": _TOML},
        ("camera.to_phantom", *says),
    )


_FILES = {
    "surface missing": _one(remove(_STL), "not found", "expected this file"),
    "surface is a folder": _one(make_folder(_STL), "folder"),
    "surface through a link": _one(_linked, "through a link"),
    "surface of zero bytes": _one(write(_STL, b""), "export it"),
    "surface of text": _one(write(_STL, b"no surface at all"), "export it"),
    "surface with an ASCII head alone": _one(write(_STL, "solid body\nendsolid\n"), "no triangle"),
    "surface cut off": _one(
        change(_STL, lambda data: data[:-70]), "614 bytes", "12 triangles has 684", "export it"
    ),
    "surface with a wrong count": _one(
        change(_STL, lambda data: data[:80] + (10**6).to_bytes(4, "little") + data[84:]),
        "export it",
    ),
    "surface too large": _one(_huge, "32 MiB", "at most 32", "palpate surface", "--tolerance"),
    "surface of another format": _one(
        _named("phantom.step", "ISO-10303-21;"), "expected one of .stl, .ply, .obj", "export it",
        file="phantom.step",
    ),
    "surface with another extension": _one(
        _named("phantom.obj", b"solid body\n" * 9), "no triangle", file="phantom.obj"
    ),
    "surface of quadrilaterals, open": _one(
        _named("phantom.obj", _OPEN_QUADS), "is open", "--close-base", file="phantom.obj"
    ),
    "surface of points alone": _one(
        _named("phantom.ply", _POINTS), "no triangle", "with its faces", file="phantom.ply"
    ),
    "surface that names a vertex beyond its own": _one(
        _named("phantom.ply", _BEYOND), "export it", file="phantom.ply"
    ),
    "surface above the folder": _one(
        replace(_TOML, '"phantom.stl"', '"../phantom.stl"'), "phantom.surface", "plain name",
        file=_TOML,
    ),
    "no surface named": _one(
        replace(_TOML, 'surface = "phantom.stl"', ""), "phantom.surface is missing", file=_TOML
    ),
    "size beside a surface": _one(
        replace(_TOML, "mass", "size = [0.06, 0.04, 0.03]\nmass"), "phantom.size", "remove this",
        file=_TOML,
    ),
}  # fmt: skip

_FORMS = {
    "vertex of nan": _one(_surface(_with_nan), "not finite", "nan", "export it"),
    "infinite vertex": _one(_surface(lambda v, t: (np.where(v > 0.029, np.inf, v), t)), "inf"),
    "open bottom": _one(_surface(_without_base), "is open", "1 hole", "palpate surface", "--close"),
    "one triangle left out": _one(_surface(lambda v, t: (v, t[:-1])), "is open", "--fill-holes"),
    "one triangle": _one(_surface(_alone), "is open"),
    "no triangle": _one(_surface(lambda v, t: (v, t[:0])), "no triangle"),
    "inside out": _one(_surface(lambda v, t: (v, t[:, ::-1])), "inwards", "--orient"),
    "mixed triangles": _one(_surface(_mixed), "2 of 12 triangles are flipped", "--orient"),
    "doubled triangles": _one(
        _surface(lambda v, t: (v, np.concatenate([t, t[:3]]))),
        "more than two triangles", "--clean",
    ),
    "triangle with a corner twice": _one(
        _surface(lambda v, t: (v, np.concatenate([t, [(1, 1, 2)]]))),
        "a corner twice", "--clean",
    ),
    "triangle without an area": _one(_surface(_line), "no area", "on a line", "--clean"),
    "inner wall": _one(
        _surface(_joined((0.0, 0.0, 0.03), _SIZE)), "more than two triangles", "--rebuild"
    ),
    "crossing itself": _one(_surface(_spiked), "cross", "--rebuild"),
    "two bodies": _one(
        _surface(_joined((0.1, 0.0, 0.0), (0.01, 0.01, 0.01))),
        "2 separate", "72, 1 cm3", "--body 1",
    ),
    "two bodies that overlap": _one(
        _surface(_joined((0.02, 0.01, 0.005), (0.05, 0.04, 0.02))), "2 separate", "--rebuild"
    ),
    "in millimetres": _one(_scaled(1e3), "60 x 40 x 30 m", "in mm", "unit"),
    "scaled twice": _one(_scaled(1e-3), "0.001"),
    "of kilometres": _one(_scaled(1e6), "expected 0.001 to 2 m"),
    "flat as paper": _one(_surface(_flat), "0.0003 m", "expected 0.001 to 2 m"),
    "nothing stands on the table": _one(_surface(_no_base), "no triangle lies below", "held"),
}  # fmt: skip

_POSES = {
    "pose that mirrors": _pose(
        "[[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, -1.0, 0.3], [0, 0, 0, 1.0]]",
        "right-handed", "signs",
    ),
    "pose in millimetres": _pose(
        "[[1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, -1.0, 300.0], [0, 0, 0, 1.0]]",
        "[2][3] = 300", "millimetres", "0.3 m",
    ),
    "pose with a scale": _pose(
        "[[2.0, 0, 0, 0], [0, 2.0, 0, 0], [0, 0, 2.0, 0.3], [0, 0, 0, 1.0]]", "without scale"
    ),
    "pose column by column": _pose(
        "[[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0.3, 1.0]]", "row by row"
    ),
    "pose of three rows": _pose("[[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0]]", "4x4"),
}  # fmt: skip

SHAPE_BREAKAGES: dict[str, Breakage] = {**_FILES, **_FORMS, **_POSES}
