from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import dome

from palpate.foundation.errors import MeshError
from palpate.mesh.push_meshes import REPLAY_PUSHES, SCREEN_PUSHES, PushMeshSpec
from palpate.mesh.tet_fill import TetSpec
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup, Tool

RADII = (0.03, 0.022, 0.02)
DOME = Setup(geometry=dome(RADII), tool=Tool(radius=5e-3))
PLACES = np.array([[0.0, 0.0, RADII[2]], [RADII[0] * np.cos(0.9), 0.0, RADII[2] * np.sin(0.9)]])


def test_each_push_has_its_own_mesh_that_is_fine_there() -> None:
    spec = SCREEN_PUSHES.at(PLACES)
    meshes = [spec.mesh(DOME, place + np.array([0.0, 0.0, 4e-3])) for place in PLACES]
    assert spec.mesh(DOME, PLACES[0]) is meshes[0] is not meshes[1]
    for mesh, place, elsewhere in zip(meshes, PLACES, PLACES[::-1], strict=True):
        near = np.linalg.norm(mesh.nodes - place, axis=1) < 4e-3
        other = np.linalg.norm(mesh.nodes - elsewhere, axis=1) < 4e-3
        assert near.sum() > other.sum()


def test_push_resists_as_on_one_mesh_for_all() -> None:
    centre = PLACES[0] + np.array([0.0, 0.0, 5e-3 - 3e-3])
    own = Replay(DOME, REPLAY_PUSHES.at(PLACES), 1e-4).solve_from_any(centre, (None,))
    whole = Replay(
        DOME, TetSpec.along(centre[None], 5e-3, spacing=1.2e-3, coarsest=3e-3), 1e-4
    ).solve_from_any(centre, (None,))
    assert own.force[2] == pytest.approx(whole.force[2], rel=0.04)


def test_tool_of_another_size_gets_meshes_in_proportion() -> None:
    small = REPLAY_PUSHES.for_tool(2.5e-3)
    assert small.spacing == pytest.approx(
        REPLAY_PUSHES.spacing / 2
    ) and small.reach == pytest.approx(REPLAY_PUSHES.reach / 2)
    assert REPLAY_PUSHES.finer().spacing == pytest.approx(REPLAY_PUSHES.spacing / 1.5)


def test_spec_without_places_or_with_spacings_out_of_order_is_refused() -> None:
    with pytest.raises(MeshError, match="no place that is pushed was named"):
        PushMeshSpec().mesh(DOME, PLACES[0])
    with pytest.raises(MeshError, match="not in this order"):
        replace(PushMeshSpec(), spacing=5e-3)
