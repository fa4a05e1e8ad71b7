"""Deep pushes sought at once: none may end in an equilibrium that its way does not lead to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import box_surface

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.jump_check import agree, pulls
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Box, Material, Setup, Shape, Tool

THIN = Setup(
    geometry=Box(size=(0.016, 0.014, 0.006485)),
    tool=Tool(radius=3.852e-3),
    material=Material(poisson_ratio=0.45),
)
"""A ball of nearly 4 mm, and some 6 mm of soft tissue over a held floor."""
GRID, DEEP = GridSpec(nodes=(7, 7, 5)), 6.095e-3


def _push(*depths: float) -> Equilibrium:
    """The last frame of a push into the thin block by these depths [m], from rest."""
    block, frame = Replay(THIN, GRID, 1e-3), None
    for depth in depths:
        height = THIN.geometry.height + THIN.tool.radius - depth
        frame = block.solve_from_any(np.array([-2.602e-3, 0.915e-3, height]), (frame,))
    assert frame is not None
    return frame


def test_push_at_once_into_thin_tissue_is_that_by_way_of_half_the_depth_or_none():
    way = _push(0.5 * DEEP, 0.75 * DEEP, DEEP)
    once = _push(DEEP)
    assert way.outcome is Outcome.CONVERGED and way.force[2] > 0
    assert once.outcome is not Outcome.CONVERGED or agree(way, once)


def test_push_to_half_of_thin_tissue_is_the_same_at_once_and_in_steps():
    once, way = _push(0.5 * DEEP), _push(0.2 * DEEP, 0.35 * DEEP, 0.5 * DEEP)
    assert once.outcome is way.outcome is Outcome.CONVERGED
    assert not pulls(once)
    assert np.allclose(once.force, way.force, rtol=5e-3, atol=1e-3)
    assert agree(once, way) and not agree(once, replace(way, force=1.1 * way.force))


def test_body_that_draws_the_tool_in_is_told_from_one_that_resists():
    frame = _push(0.4 * DEEP)
    assert not pulls(frame)
    assert pulls(replace(frame, force=-frame.force))
    assert not pulls(replace(frame, force=np.zeros(3)))


@pytest.mark.parametrize("body", [THIN.geometry, Shape(*box_surface((0.016, 0.014, 0.006485)))])
def test_next_to_a_held_floor_the_normal_is_still_that_of_the_free_surface(body):
    points: FloatArray = np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, 5e-3], [7.5e-3, 0.0, 2e-3]])
    distances, normals = body.facing_free(points)
    assert np.allclose(normals, [[0, 0, 1], [0, 0, 1], [1, 0, 0]])
    assert np.allclose(distances, [-5.485e-3, -1.485e-3, -0.5e-3])
