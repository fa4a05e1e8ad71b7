"""The free surface of a body as one mesh: closed, bordered where it is held, seen from above."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import box_surface, cut_ball, dome

from palpate.app.drawing.free_surface import FreeSurface, creases
from palpate.setup.free_form.fixed_region import Plane
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Box

BODIES = [Box(size=(0.06, 0.04, 0.03)), dome((0.04, 0.03, 0.025)), cut_ball(0.03, 0.02)]


def free(body: Geometry) -> FreeSurface:
    surface = body.surface()
    return FreeSurface.of(surface.vertices, surface.faces)


@pytest.mark.parametrize("body", BODIES)
def test_closed_surface_has_the_volume_of_the_body(body: Geometry) -> None:
    vertices, faces = free(body).closed
    a, b, c = vertices[faces].transpose(1, 0, 2)
    volume = np.einsum("ti,ti->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(body.volume, rel=1e-6)


@pytest.mark.parametrize("body", BODIES)
def test_border_is_one_line_around_what_is_held(body: Geometry) -> None:
    surface = free(body)
    edges, _ = surface.border
    assert np.array_equal(np.roll(edges[:, 0], -1), edges[:, 1])
    assert surface.vertices[edges][..., 2] == pytest.approx(0.0, abs=1e-9)


def test_border_of_a_body_held_higher_up_lies_there() -> None:
    body = dome((0.04, 0.03, 0.025), Plane(height=0.01))
    heights = free(body).vertices[free(body).border[0]][..., 2]
    assert heights == pytest.approx(0.01, abs=2e-3)


@pytest.mark.parametrize("body", BODIES)
def test_heights_are_those_of_the_surface_and_missing_beside_it(body: Geometry) -> None:
    found = free(body).height_map
    rows, columns = np.indices(found.heights.shape)
    places = found.corner + found.spacing * np.stack([columns, rows], axis=-1)
    seen = np.isfinite(found.heights)
    # A cell has its highest point: on a slope it is above the surface over the cell's middle.
    above = found.heights[seen] - body.heights(places[seen])
    assert np.percentile(above, 5) > -1e-4 and np.median(above) < 1e-3
    beside = np.column_stack([places[~seen], np.full((~seen).sum(), 0.005)])
    assert not len(beside) or body.outside(beside).min() > -found.spacing


def test_creases_are_the_edges_of_a_block_and_none_of_a_smooth_dome() -> None:
    block = creases(*box_surface((0.06, 0.04, 0.03)), np.radians(40))
    lengths = np.linalg.norm(block[:, 1] - block[:, 0], axis=1)
    assert sorted(lengths.round(6)) == [0.03] * 4 + [0.04] * 4 + [0.06] * 4
    body = dome((0.04, 0.03, 0.025))
    edges = creases(*body.closed_surface, np.radians(40))
    assert len(edges) == 64
    assert edges[..., 2] == pytest.approx(0.0)
