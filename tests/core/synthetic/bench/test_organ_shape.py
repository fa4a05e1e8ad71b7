from __future__ import annotations

import numpy as np
import pytest

from palpate.setup.setup import Shape
from palpate.synthetic.bodies.organ_shape import (
    organ_block,
    organ_normals,
    organ_places,
    organ_surface,
)

WAYS = np.array([[0.1, 0.2, 1.0], [0.8, -0.3, 0.5], [-0.5, 0.6, 0.4]])


def test_surface_lies_on_the_formula_and_faces_outwards() -> None:
    vertices, triangles = organ_surface()
    shape = Shape(vertices, triangles)
    distance, normals = shape.facing(organ_places(WAYS))
    assert np.abs(distance).max() < 1.5e-4
    assert (np.einsum("ni,ni->n", normals, organ_normals(organ_places(WAYS))) > 0.98).all()


def test_finer_triangles_enclose_the_same_organ() -> None:
    coarse, fine = (Shape(*organ_surface(edge)).volume for edge in (2.5e-3, 1.6e-3))
    assert coarse == pytest.approx(fine, rel=5e-3)


def test_body_fills_the_organ_with_sides_bent_along_the_formula() -> None:
    block = organ_block(organ_places(WAYS[:1]), 4e-3, 4e-3)
    assert block.weights.sum() == pytest.approx(Shape(*organ_surface(1.2e-3)).volume, rel=3e-3)
    assert block.weights.min() > 0
    free = block.surface_rest[block.surface_rest[:, 2] > 1e-4]
    away = np.linalg.norm(free, axis=1) - np.linalg.norm(organ_places(free), axis=1)
    assert np.abs(away).max() < 2e-4
