"""The engine against CalculiX, which has other elements, contact, volumetric law and solver."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calculix import poke

from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay, require_converged
from palpate.setup.setup import Box, Setup, Tool

SETUP = Setup(geometry=Box(size=(0.0687, 0.0393, 0.0358)), tool=Tool(radius=5e-3), mass=0.104)
GRID = GridSpec(nodes=(25, 19, 13), spacing=0.8e-3, order=2)
DEPTHS = (4e-3, 8e-3)
CCX = shutil.which("ccx")


@pytest.mark.slow
@pytest.mark.skipif(
    CCX is None, reason="no CalculiX on this machine: install the package calculix-ccx"
)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_two_pokes_are_those_of_calculix(friction: float, tmp_path: Path) -> None:
    setup = replace(SETUP, tool=replace(SETUP.tool, friction_coefficient=friction))
    referee = poke(str(CCX), setup, DEPTHS, tmp_path)
    top = SETUP.geometry.size[2] + SETUP.tool.radius
    frames = replay(
        setup, np.array([[0.0, 0.0, top - depth] for depth in np.arange(1, 9) * 1e-3]), GRID
    )
    require_converged(frames)
    for number, frame in enumerate((frames[3], frames[7])):
        force = SETUP.material.young_modulus * referee.force[number]
        assert frame.force[2] == pytest.approx(force, rel=0.02)
        miss = frame.move(referee.rest) - referee.rest - referee.displacement[number]
        assert np.sqrt((miss**2).sum(axis=1).mean()) < 0.13e-3
