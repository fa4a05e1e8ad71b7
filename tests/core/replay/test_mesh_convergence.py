from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.newton import Outcome
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.mesh_convergence import hardest_frames, mesh_errors
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
TOP = SIZE[2] + 5e-3
POKE = np.array([[0.0, 0.0, TOP - depth] for depth in (-1e-3, 1.5e-3, 3e-3, 4e-3, 2e-3, -1e-3)])


@pytest.mark.parametrize(
    "grid",
    [
        GridSpec(nodes=(13, 9, 8), spacing=1.5e-3),
        GridSpec(nodes=(13, 9, 9), spacing=1.5e-3, order=2),
    ],
)
def test_estimate_is_near_the_error_against_a_much_finer_grid(grid):
    frames = replay(SETUP, POKE, grid)
    (miss,) = mesh_errors(SETUP, frames, grid)
    fine = replay(SETUP, POKE[1:4], GridSpec(nodes=(25, 19, 15), spacing=0.7e-3))[-1]
    x, y = np.meshgrid(np.linspace(-0.033, 0.033, 41), np.linspace(-0.019, 0.019, 25))
    top = np.stack([x.ravel(), y.ravel(), np.full(x.size, SIZE[2])], axis=1)
    here, there = frames[miss.frame].move(top) - top, fine.move(top) - top
    true = np.linalg.norm(here - there) / np.linalg.norm(there)
    assert 0.5 * miss.relative < true < 2 * miss.relative


def test_hardest_frames_are_one_for_each_touch():
    frames = replay(SETUP, np.concatenate([POKE, POKE]), GridSpec())
    assert hardest_frames(frames) == [3, 9]
    assert hardest_frames(frames[:1]) == []


def test_frames_without_equilibrium_are_never_the_hardest():
    frames = replay(SETUP, POKE, GridSpec())
    frames[3] = replace(frames[3], outcome=Outcome.ITERATIONS)
    assert hardest_frames(frames) == [2]


def test_mesh_error_is_that_of_the_slid_block():
    sliding = replace(SETUP, support=Support(friction_coefficient=0.1))
    sideways = np.array(
        [[-SIZE[0] / 2 - 5e-3 + push, 0.0, 0.02] for push in (-1e-3, 1e-3, 2e-3, 4e-3)]
    )
    frames = replay(sliding, sideways, GridSpec())
    assert frames[-1].slip[0] > 1e-3
    (slid,) = mesh_errors(sliding, frames, GridSpec())
    local = sideways[slid.frame] - np.append(frames[slid.frame].slip, 0.0)
    (stuck,) = mesh_errors(
        SETUP, replay(SETUP, np.array([sideways[0], local]), GridSpec()), GridSpec()
    )
    assert slid.displacement == pytest.approx(stuck.displacement, rel=0.02)


def test_finer_grid_has_the_same_kind():
    assert GridSpec(nodes=(13, 5, 5)).finer() == GridSpec(nodes=(19, 7, 7))
    assert GridSpec(nodes=(13, 9, 9), spacing=1.5e-3, order=2).finer() == GridSpec(
        nodes=(19, 13, 13), spacing=1e-3, order=2
    )


def test_replay_that_never_touches_has_no_mesh_error():
    away = POKE + np.array([0.0, 0.0, 0.02])
    assert mesh_errors(SETUP, replay(SETUP, away, GridSpec()), GridSpec()) == ()
