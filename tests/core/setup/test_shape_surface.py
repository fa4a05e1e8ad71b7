"""The free surface of a shape: like a block's where the shape is one, and even on a dome."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import box_surface, dome

from palpate.setup.box import Box
from palpate.setup.free_form.shape import Shape
from palpate.setup.phantom_geometry import Surface

SIZE = (0.0687, 0.0393, 0.0358)
BLOCK = Box(size=SIZE).surface()
SAME = Shape(*box_surface(SIZE)).surface()
DOME = dome((0.04, 0.03, 0.025)).surface()


def areas(surface: Surface) -> np.ndarray:
    a, b, c = surface.vertices[surface.faces.T]
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def middles(surface: Surface) -> np.ndarray:
    return np.asarray(surface.vertices[surface.faces].mean(axis=1))


def test_block_as_a_surface_has_five_sides_and_about_as_many_patches() -> None:
    assert set(SAME.side) == set(range(5))
    assert areas(SAME).sum() == pytest.approx(areas(BLOCK).sum())
    assert SAME.patches == pytest.approx(BLOCK.patches, rel=0.05)
    for normal in BLOCK.patch_normals:
        assert (SAME.patch_normals @ normal).max() > 0.999


def test_no_edge_is_longer_than_the_spacing() -> None:
    for surface in (SAME, DOME):
        a, b, c = surface.vertices[surface.faces.T]
        longest = max(np.linalg.norm(b - a, axis=1).max(), np.linalg.norm(c - b, axis=1).max())
        assert longest <= 1.5e-3 + 1e-9


def test_distance_to_edges_is_the_block_s() -> None:
    points, side = middles(BLOCK)[::17], BLOCK.side[::17]
    wanted = BLOCK.edge_distance(points, side)
    np.testing.assert_allclose(SAME.edge_distance(points, side), wanted, atol=2e-5)


@pytest.mark.parametrize("surface", [SAME, DOME], ids=["block", "dome"])
def test_patches_are_even_and_hold_their_centres(surface: Surface) -> None:
    patch = surface.patch_of(middles(surface), surface.side)
    size = np.bincount(patch, areas(surface), minlength=surface.patches)
    assert np.quantile(size, 0.05) > 0.5 * surface.patch**2
    assert np.quantile(size, 0.95) < 1.6 * surface.patch**2
    apart = np.linalg.norm(middles(surface) - surface.patch_centres[patch], axis=1)
    assert apart.max() < 1.2 * surface.patch


@pytest.mark.parametrize("surface", [BLOCK, SAME, DOME], ids=["block", "same", "dome"])
def test_tangents_span_the_surface(surface: Surface) -> None:
    first, second = surface.tangents(middles(surface), surface.side)
    a, b, c = surface.vertices[surface.faces.T]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(np.cross(first, second), normal, atol=1e-9)


def test_surface_of_a_longer_body_has_the_same_patches_at_their_places() -> None:
    stated = dome((0.04, 0.03, 0.025))
    factors = np.array([1.05, 0.96, 1.1])
    longer = stated.scaled(factors)
    surface = longer.surface(stated=stated)
    assert surface.patches == DOME.patches
    np.testing.assert_allclose(surface.on_stated(surface.vertices), DOME.vertices, atol=1e-12)
    distance, normals = longer.facing(surface.patch_centres)
    assert np.abs(distance).max() < 1e-5
    assert np.einsum("pi,pi->p", normals, surface.patch_normals).min() > 0.9
    first, second = surface.tangents(middles(surface), surface.side)
    a, b, c = surface.vertices[surface.faces.T]
    across = np.cross(b - a, c - a)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    np.testing.assert_allclose(np.cross(first, second), across, atol=1e-6)
    assert longer.held.sum() == stated.held.sum()
    assert longer.height == pytest.approx(0.0275)


def test_dome_has_one_side_that_ends_at_its_base() -> None:
    assert set(DOME.side) == {0}
    low = middles(DOME)[:, 2] < 1e-3
    assert DOME.edge_distance(middles(DOME)[low], DOME.side[low]).max() < 2e-3
