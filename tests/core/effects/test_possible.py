"""Effects that a phantom cannot have, and the places in it that effects begin at and range over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from outside_catalogue import Coating
from shape_run import liver
from shapes import dome

from palpate.diagnosis.inference.applicable_effects import applicable_effects
from palpate.effects import DIAGNOSED
from palpate.effects.elastic_material import StiffInclusion, inclusion_grid
from palpate.effects.geometry import GeometryLocal
from palpate.effects.heterogeneity import StiffTube
from palpate.effects.support import BaseDetachment
from palpate.effects.tool import LandmarkMismatch
from palpate.setup.free_form.fixed_region import Plane
from palpate.setup.setup import Box, Setup, Tool, Tracing

TOOL = Tool(radius=5e-3)
BLOCK = Setup(geometry=Box(size=(0.07, 0.04, 0.036)), tool=TOOL, landmarks=((0.0, 0.0, 0.036),) * 3)
LIVER = Setup(geometry=liver(), tool=TOOL, landmarks=((0.03, -0.02, 0.02),) * 3)


def test_what_a_phantom_cannot_have_says_why() -> None:
    traced = Tracing(centres=((0.0, 0.0, 0.03),), radius=5e-3)
    deep = Setup(geometry=dome((0.04, 0.03, 0.025), Plane(0.01)), tool=TOOL, tracing=traced)
    assert "only a block" in Coating.impossible(LIVER)
    assert "surface" in GeometryLocal.impossible(BLOCK)
    assert "flat base" in BaseDetachment.impossible(deep)
    assert "by traces" in LandmarkMismatch.impossible(deep)
    assert not any(kind.impossible(LIVER) for kind in DIAGNOSED)
    diagnosed = applicable_effects(deep, clouds=True, forces=True)
    assert not {BaseDetachment, LandmarkMismatch} & set(diagnosed)
    assert set(diagnosed) < set(applicable_effects(LIVER, clouds=True, forces=True))


def test_lumps_and_tubes_begin_in_the_body_wherever_its_frame_is() -> None:
    grid = np.array([(one.x, one.y, one.z) for one in inclusion_grid(LIVER)])
    assert len(grid) > 10 and LIVER.geometry.outside(grid).max() < 0
    assert LIVER.geometry.outside(grid).min() < -6e-3
    middle = StiffInclusion.neutral(LIVER).inclusion
    assert LIVER.geometry.outside(np.array([[middle.x, middle.y, middle.z]]))[0] < 0
    tubes = StiffTube.starts(LIVER)
    assert all(len(tube.located(LIVER)["polyline"]) for tube in tubes)


def test_grid_of_a_block_is_about_its_middle() -> None:
    grid = np.array([(one.x, one.y, one.z) for one in inclusion_grid(BLOCK)])
    np.testing.assert_allclose(grid[:, :2].mean(axis=0), 0.0, atol=1e-12)
    assert len(grid) == 42 and grid[:, 0].max() == pytest.approx(3 / 7 * 0.07)


def test_places_range_over_the_body_alone() -> None:
    spans = StiffInclusion.spans(LIVER.geometry)
    for axis, name in enumerate("xyz"):
        low, high = spans[name]
        assert (low, high) == (LIVER.geometry.low[axis], LIVER.geometry.high[axis])
    assert StiffTube.spans(LIVER.geometry)["z"] == spans["z"]
    assert StiffInclusion.spans(BLOCK.geometry)["x"] == (-0.035, 0.035)


def test_a_strip_of_a_wide_base_begins_within_its_bounds() -> None:
    wide = replace(BLOCK, geometry=Box(size=(0.25, 0.2, 0.06)))
    assert {one.extent for one in BaseDetachment.starts(wide)} == {0.04}
    short = [one.extent for one in BaseDetachment.starts(BLOCK)]
    assert short == pytest.approx([0.35 * 0.07] * 2 + [0.35 * 0.04] * 2)


def test_depth_of_a_lump_in_a_free_form_is_that_below_its_skin() -> None:
    body = LIVER.geometry
    top = np.array([[0.0, -0.02, 0.0]])
    top[0, 2] = body.heights(top[:, :2])[0]
    lump = StiffInclusion(x=0.0, y=-0.02, z=top[0, 2] - 8e-3, radius=5e-3, stiffness_ratio=4.0)
    depth = lump.located(LIVER)["depth"]
    # The skin is sloped there, so that it is nearer than straight above.
    assert depth["unit"] == "m" and 4e-3 < depth["value"] <= 8e-3
    centre = np.array([[lump.x, lump.y, lump.z]])
    free = body.surface(1e-3).vertices
    nearest = np.linalg.norm(free - centre, axis=1).min()
    assert depth["value"] == pytest.approx(nearest, rel=0.02)
    assert lump.located(BLOCK) == {}
    said = StiffInclusion.phrase({**lump.values(), "depth": "7 mm"}, body.size)
    assert said.endswith("its centre 7 mm under the surface")
