"""Families of phantoms with random proportions."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.synthetic.bodies.shape_families import FAMILIES, draw_shape


@pytest.mark.parametrize("family", FAMILIES)
def test_bodies_are_closed_stand_on_their_base_and_differ(family: str) -> None:
    one, other = (draw_shape(family, seed) for seed in (1, 2))
    for body in (one, other):
        assert body.flat_base and body.low[2] == pytest.approx(0.0, abs=1e-12)
        assert 15e-6 < body.volume < 300e-6
        assert 0.3 < body.held.mean() < 0.7
    assert one != other and draw_shape(family, 1) == one


def test_pads_have_upright_sides_and_organs_have_none() -> None:
    for family, upright in (("cylinder", True), ("grooved", True), ("dome", False)):
        body = draw_shape(family, 3)
        a, b, c = body.corners.transpose(1, 0, 2)
        across = np.cross(b - a, c - a)
        level = np.abs(across[:, 2]) < 1e-9 * np.linalg.norm(across, axis=1)
        assert bool(level.mean() > 0.02) is upright
