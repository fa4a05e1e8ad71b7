"""Closed surfaces for tests, and bodies of tetrahedra made from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.tet_fill import TetSpec, fill
from palpate.mesh.tet_mesh import TetMesh
from palpate.setup.free_form.fixed_region import FixedRegion, Plane
from palpate.setup.setup import Shape
from palpate.synthetic.bodies.organ_shape import write_surface

__all__ = ["box_surface", "cut_ball", "dome", "filled_box", "write_felt_shape"]

_MARKS = [(0.03, 0.02, 0.03), (0.03, -0.02, 0.03), (-0.03, -0.02, 0.03), (-0.03, 0.02, 0.03)]


def box_surface(size: tuple[float, float, float]) -> tuple[FloatArray, IntArray]:
    """The twelve triangles of a block that stands on z = 0 [m]."""
    box = trimesh.creation.box(size)
    return np.array(box.vertices) + np.array([0.0, 0.0, size[2] / 2]), np.array(box.faces)


def filled_box(size: tuple[float, float, float], spacing: float) -> TetMesh:
    """A block of tetrahedra, evenly spaced [m]."""
    return fill(
        Shape(*box_surface(size)), TetSpec(path=(), radius=1e-3, spacing=spacing, coarsest=spacing)
    )


def dome(
    radii: tuple[float, float, float], fixed: FixedRegion | None = None, rings: int = 16
) -> Shape:
    """Half an ellipsoid with these semi-axes [m] on a flat base in z = 0."""
    rise = np.linspace(0, np.pi / 2, rings + 1)[:-1]
    turn = np.linspace(0, 2 * np.pi, 4 * rings, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rings_of = [
        np.column_stack([np.cos(up) * around, np.full(len(turn), np.sin(up))]) for up in rise
    ]
    vertices = np.concatenate([*rings_of, [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]]) * np.array(radii)
    count, here = len(turn), np.arange(len(turn))
    beside, top, middle = (here + 1) % count, len(vertices) - 2, len(vertices) - 1
    triangles = []
    for ring in range(rings - 1):
        low, high = ring * count, (ring + 1) * count
        triangles += [
            np.stack([low + here, low + beside, high + beside], 1),
            np.stack([low + here, high + beside, high + here], 1),
        ]
    last = (rings - 1) * count
    triangles += [np.stack([last + here, last + beside, np.full(count, top)], 1)]
    triangles += [np.stack([beside, here, np.full(count, middle)], 1)]
    return Shape(vertices, np.concatenate(triangles), fixed or Plane(), "dome")


def cut_ball(radius: float, middle: float) -> Shape:
    """A ball [m] around the height `middle` [m], below its radius, cut off at z = 0: its lower part
    overhangs.
    """
    ball = trimesh.creation.icosphere(3, radius)
    vertices = np.array(ball.vertices) + np.array([0.0, 0.0, middle])
    vertices[:, 2] = np.maximum(vertices[:, 2], 0.0)
    return Shape(vertices, np.array(ball.faces), name="ball")


def write_felt_shape(
    root: Path, vertices: FloatArray, triangles: IntArray, surface: str = 'surface = "phantom.stl"'
) -> Path:
    """Write a dataset of a shape: one push into the middle of the top, felt.

    Robot and phantom have one frame.
    """
    write_surface(root / "phantom.stl", vertices, triangles)
    lines = [
        'format = 1\nname = "felt"\n[phantom]\ngeometry = "mesh"',
        surface,
        'mass = 0.1\nfixed = "base"\n[tool]\nshape = "sphere"',
        "radius = 0.005\n[landmarks]",
        *(f"mark_{n} = {list(place)}" for n, place in enumerate(_MARKS)),
        '[splits]\ntrain = ["p1"]',
    ]
    (root / "dataset.toml").write_text("\n".join(lines) + "\n")
    rows = [f"mark_{n},{x},{y},{z}" for n, (x, y, z) in enumerate(_MARKS)]
    (root / "touches.csv").write_text("\n".join(["landmark,x,y,z", *rows]) + "\n")
    folder = root / "sequences" / "p1"
    folder.mkdir(parents=True)
    time = np.arange(0, 6, 0.02)
    height = 0.045 - 0.014 * np.clip(np.minimum(time - 1, 5 - time), 0, 1)
    rows = [f"{t:.2f},0,0,{z:.6f},0,0,0,1" for t, z in zip(time, height, strict=True)]
    (folder / "kinematics.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]) + "\n")
    rows = [f"{t:.2f},0,0,{max(0.035 - z, 0) * 30:.5f}" for t, z in zip(time, height, strict=True)]
    (folder / "forces.csv").write_text("\n".join(["t,fx,fy,fz", *rows]) + "\n")
    return root
