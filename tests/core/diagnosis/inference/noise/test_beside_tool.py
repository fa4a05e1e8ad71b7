"""Patches beside the tool in depth that a filter has smoothed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pushed_block import GRID, SETUP, poke, prediction

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.noise.beside_tool import beside_tool, width_of_smoothing
from palpate.diagnosis.inference.noise.noise_model import noises
from palpate.replay.replay import replay

SURFACE = SETUP.surface()
FAR, ABOVE, INSIDE = 0, 1, 2


def _replayed() -> Prediction:
    """Groups with the ball far above the top, 1 mm above it and 4 mm inside."""
    frames = tuple(replay(SETUP, np.array([poke(-0.1), poke(-1e-3), poke(4e-3)]), GRID))
    gap = np.zeros((3, SURFACE.patches))
    return replace(prediction(gap, columns=np.zeros((*gap.shape, 1))), equilibria=frames)


def test_patches_by_the_ball_are_found_whether_it_touches_or_not() -> None:
    item = _replayed()
    found = beside_tool(item, SURFACE.patch_centres, 3e-3)
    assert not found[FAR].any() and found[ABOVE].any() and found[INSIDE].any()
    for group in (ABOVE, INSIDE):
        frame = item.equilibria[group]
        places = frame.move(SURFACE.patch_centres)
        away = np.linalg.norm(places - frame.tool.centre, axis=1) - frame.tool.radius
        assert away[found[group]].max() < 3e-3 <= away[~found[group]].min()


def test_dented_surface_is_where_the_model_has_it() -> None:
    item = _replayed()
    frame = item.equilibria[INSIDE]
    centres = SURFACE.patch_centres
    before = np.linalg.norm(centres - frame.tool.centre, axis=1) < frame.tool.radius + 1e-3
    after = beside_tool(item, centres, 1e-3)[INSIDE]
    assert after.any() and (before & ~after).any()


def test_width_is_the_stated_one_or_the_usual_one_where_points_share_noise() -> None:
    assert width_of_smoothing(0.0, 0.0) == 0.0
    assert width_of_smoothing(0.0, 0.2) == CRITERIA.noise.smoothed
    assert width_of_smoothing(5e-3, 0.2) == 5e-3 > CRITERIA.noise.smoothed


def test_patches_beside_the_tool_count_unless_a_filter_smoothed_them() -> None:
    item = _replayed()
    lumps = slice(0, 1)
    sharp = noises([item], [item], SURFACE, lumps)[0]
    smooth = noises([item], [item], SURFACE, lumps, edge=3e-3)[0]
    found = beside_tool(item, SURFACE.patch_centres, 3e-3)
    assert (sharp.weights > 0).all()
    assert np.array_equal(smooth.weights == 0, found)
