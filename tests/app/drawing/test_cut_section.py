"""A cut through a block: nothing is lost, and what is new lies in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import cut_ball, dome

from palpate.app.drawing.cut_section import clipped, cut_face, depth_inside
from palpate.app.drawing.free_surface import FreeSurface
from palpate.app.drawing.surface_bands import FineSurface, refine
from palpate.app.drawing.view import Section
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Box

SIZE = (0.06, 0.04, 0.03)
PLANES = [("x", 0.0113), ("y", -0.007), ("z", 0.021), ("z", 0.0)]


def block() -> tuple[FloatArray, FineSurface]:
    mesh = box_mesh(SIZE, GridSpec(nodes=(5, 4, 3)))
    quads = mesh.free_surface
    return mesh.nodes, refine(
        mesh.nodes, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), 3
    )


def area(points: FloatArray, faces: np.ndarray) -> float:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(("axis", "at"), PLANES)
def test_both_parts_together_are_the_whole(axis, at):
    rest, surface = block()
    parts = [clipped(surface, rest, Section(axis=axis, at=at, flip=flip)) for flip in (False, True)]
    whole = area(surface.spread(rest), surface.faces)
    assert sum(area(part.spread(rest), part.faces) for part in parts) == pytest.approx(
        whole, rel=1e-9
    )
    for part, flip in zip(parts, (False, True), strict=True):
        used = part.spread(rest)[np.unique(part.faces)]
        assert np.all(depth_inside(Section(axis=axis, at=at, flip=flip), used) > -1e-12)


def test_new_points_move_with_the_material_and_keep_the_outward_turn():
    rest, surface = block()
    part = clipped(surface, rest, Section(axis="x", at=0.0113))
    moved = rest * [1.0, 1.1, 0.9] + [0.0, 0.0, 0.01]
    assert part.spread(moved) == pytest.approx(
        part.spread(rest) * [1.0, 1.1, 0.9] + [0.0, 0.0, 0.01]
    )
    places = part.spread(rest)
    a, b, c = (places[part.faces[:, k]] for k in range(3))
    outwards = (a + b + c) / 3 - np.array([0.0, 0.0, SIZE[2] / 2])
    assert np.all(np.einsum("ij,ij->i", np.cross(b - a, c - a), outwards) > -1e-15)


def test_cut_face_fills_the_opening_and_is_missing_beside_the_block():
    closed = closed_of(Box(size=SIZE))
    found = cut_face(*closed, Section(axis="y", at=0.005))
    assert found is not None
    assert np.all(found[0][:, 1] == 0.005)
    assert area(*found) == pytest.approx(0.06 * 0.03)
    assert cut_face(*closed, Section(axis="y", at=0.025)) is None


@pytest.mark.parametrize("body", [dome((0.04, 0.03, 0.025)), cut_ball(0.03, 0.02)])
@pytest.mark.parametrize("axis", "xyz")
def test_cut_faces_of_a_free_form_have_its_volume_and_none_of_them_leaves_it(body, axis):
    low, high = (float(end["xyz".index(axis)]) for end in (body.low, body.high))
    step = (high - low) / 30
    volume = 0.0
    for at in np.arange(low + step / 2, high, step):
        found = cut_face(*closed_of(body), Section(axis=axis, at=float(at)))
        assert found is not None
        assert body.outside(found[0]).max() < 4e-4
        volume += step * area(*found)
    assert volume == pytest.approx(body.volume, rel=0.01)


def closed_of(body: Geometry) -> tuple[FloatArray, np.ndarray]:
    surface = body.surface()
    return FreeSurface.of(surface.vertices, surface.faces).closed
