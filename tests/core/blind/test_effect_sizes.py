"""Sizes over the detection limit, from maps as a report has them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from palpate.blind.effect_sizes import camera_pose, size_over_limit
from palpate.effects.sensor import CameraRegistration
from palpate.foundation.frames import Transform
from palpate.setup.setup import Box, Setup, Tool
from palpate.synthetic import HiddenEffect, Scenario


def row(
    effect: str,
    *limits: dict[str, Any],
    typical: dict[str, Any] | None = None,
    at: dict[str, float] | None = None,
) -> Any:
    fixed = {name: {"value": value, "unit": "1"} for name, value in (at or {}).items()}
    return {
        "effect": effect,
        "limits": list(limits),
        "typical": typical or limits[0],
        "at": fixed,
        "alike": [],
    }


def size(hidden: HiddenEffect, ambiguity_map: Any, shift: Transform | None = None) -> float | None:
    return size_over_limit([hidden], [ambiguity_map], Scenario(), shift or Transform())


def test_change_is_counted_from_what_is_believed() -> None:
    ambiguity_map = row("tool_radius", {"parameter": "radius", "unit": "m", "change": 0.5e-3})
    assert size(HiddenEffect("tool_radius", {"radius": 3.5e-3}), ambiguity_map) == pytest.approx(
        3.0
    )


def test_two_effects_are_as_clear_as_the_fainter_one() -> None:
    radius, ratio = (
        HiddenEffect("tool_radius", {"radius": 3.5e-3}),
        HiddenEffect("poisson_ratio", {"nu": 0.25}),
    )
    ambiguity_map = [
        row("tool_radius", {"parameter": "radius", "unit": "m", "change": 0.5e-3}),
        row("poisson_ratio", {"parameter": "nu", "unit": "1", "change": 0.1}),
    ]
    assert size_over_limit(
        [radius, ratio], ambiguity_map, Scenario(), Transform()
    ) == pytest.approx(2.0)
    assert size_over_limit([radius, ratio], ambiguity_map[:1], Scenario(), Transform()) is None
    assert size_over_limit([radius], ambiguity_map[1:], Scenario(), Transform()) is None
    assert size_over_limit([], ambiguity_map, Scenario(), Transform()) is None


def test_several_parameters_add_up_as_squares_and_what_is_never_seen_adds_nothing() -> None:
    limits = [
        {"parameter": name, "unit": "m", "change": change}
        for name, change in (("dx", 1e-3), ("dy", None), ("dz", 0.5e-3))
    ]
    offset = HiddenEffect("tool_offset", {"dx": 3e-3, "dy": 9e-3, "dz": -2e-3})
    assert size(offset, row("tool_offset", *limits)) == pytest.approx(5.0)


def test_lump_is_measured_by_the_limit_of_the_nearest_place() -> None:
    def at(limit: dict[str, Any], **fixed: Any) -> dict[str, Any]:
        return {
            "at": {name: {"value": value, "unit": "1"} for name, value in fixed.items()},
            "limit": limit,
        }

    near, far = (
        {"parameter": "stiffness_ratio", "unit": "1", "factor": factor} for factor in (2.0, 4.0)
    )
    lump = HiddenEffect(
        "stiff_inclusion", {"x": 0.01, "y": 0.0, "z": 0.025, "radius": 7e-3, "stiffness_ratio": 8.0}
    )
    ambiguity_map = row("stiff_inclusion", near) | {
        "each": [at(far, x=0.0, y=0.0, z=0.01), at(near, x=0.012, y=0.001, z=0.02)]
    }
    assert size(lump, ambiguity_map) == pytest.approx((7 / 9.5) / (1 / 3.5), abs=1e-3)
    ambiguity_map["each"].reverse()
    assert size(lump, ambiguity_map) == pytest.approx((7 / 9.5) / (1 / 3.5), abs=1e-3)


def test_lump_is_measured_by_the_limit_of_half_of_the_places_and_by_its_contrast() -> None:
    best, typical = (
        {"parameter": "stiffness_ratio", "unit": "1", "factor": factor} for factor in (1.5, 2.0)
    )
    lump = HiddenEffect(
        "stiff_inclusion", {"x": 0.0, "y": 0.0, "z": 0.025, "radius": 7e-3, "stiffness_ratio": 8.0}
    )
    assert size(lump, row("stiff_inclusion", best, typical=typical)) == pytest.approx(
        (7 / 9.5) / (1 / 3.5), abs=1e-3
    )


def test_lump_acts_in_proportion_to_its_volume() -> None:
    limit = {"parameter": "stiffness_ratio", "unit": "1", "factor": 2.0}
    ambiguity_map = row(
        "stiff_inclusion", limit, at={"x": 0.0, "y": 0.0, "z": 0.025, "radius": 7e-3}
    )
    small, large = (
        size(
            HiddenEffect(
                "stiff_inclusion",
                {"x": 0.0, "y": 0.0, "z": 0.025, "radius": radius, "stiffness_ratio": 8.0},
            ),
            ambiguity_map,
        )
        for radius in (7e-3, 8.4e-3)
    )
    assert small is not None and small == pytest.approx((7 / 9.5) / (1 / 3.5), abs=1e-3)
    assert large is not None and large / small == pytest.approx(1.2**3, abs=1e-3)


def test_tube_is_measured_by_the_nearest_one_from_either_end_and_by_its_cross_section() -> None:
    straight = {"inclination": 0.0, "bend": 0.0, "sag": 0.0, "radius": 4e-3}
    crossing = {"aside": 6e-3, "z": 0.02, "heading": 0.0, **straight}
    beside = {"aside": -6e-3, "z": 0.02, "heading": math.pi / 2, **straight}
    limits = [
        {"parameter": "stiffness_ratio", "unit": "1", "factor": factor} for factor in (5.0, 3.0)
    ]
    ambiguity_map = {
        **row("stiff_tube", limits[1], typical=limits[0], at=beside),
        "each": [
            {"at": row("", limit, at=at)["at"], "limit": limit}
            for at, limit in zip((crossing, beside), limits, strict=True)
        ],
    }
    hidden = {**beside, "heading": 1.4, "radius": 5e-3, "stiffness_ratio": 3.0}
    found = size(HiddenEffect("stiff_tube", hidden), ambiguity_map)
    assert found == pytest.approx((5 / 4) ** 2, rel=1e-3)
    turned = {**hidden, "heading": 1.4 - math.pi, "aside": 6e-3}
    assert size(HiddenEffect("stiff_tube", turned), ambiguity_map) == found


def test_share_gives_a_size_only_where_the_surface_moves_in_proportion() -> None:
    sag = row("gravity", {"share": 0.25}, at={"specific_weight_over_stiffness": 1.5})
    assert size(
        HiddenEffect("gravity", {"specific_weight_over_stiffness": 3.0}), sag
    ) == pytest.approx(8.0)
    stiffening = row("strain_stiffening", {"share": 0.5}, at={"J_m": 6.0})
    assert size(HiddenEffect("strain_stiffening", {"J_m": 1.5}), stiffening) == pytest.approx(8.0)
    relaxing = row(
        "viscoelasticity", {"share": 0.1}, at={"relaxed_fraction": 0.5, "time_constant": 3.0}
    )
    assert size(
        HiddenEffect("viscoelasticity", {"relaxed_fraction": 0.6, "time_constant": 1.0}), relaxing
    ) == pytest.approx(12.0)
    slip = row("base_slip", {"share": 0.01}, at={"friction_coefficient": 0.08})
    assert size(HiddenEffect("base_slip", {"friction_coefficient": 0.1}), slip) is None


def test_detached_strip_is_measured_by_its_own_edge_and_by_the_power_that_replays_follow() -> None:
    def at(edge: str, extent: float, share: float | None) -> dict[str, Any]:
        return {
            "at": {"edge": {"value": edge, "unit": ""}, "extent": {"value": extent, "unit": "m"}},
            "limit": {"share": share},
        }

    ambiguity_map = row("base_detachment", {"share": 0.1}) | {
        "each": [at("-x", 0.024, 0.1), at("+y", 0.014, 0.5), at("-y", 0.014, None)]
    }
    assert size(
        HiddenEffect("base_detachment", {"edge": "+y", "extent": 0.014}), ambiguity_map
    ) == pytest.approx(2.0)
    assert size(
        HiddenEffect("base_detachment", {"edge": "+y", "extent": 0.007}), ambiguity_map
    ) == pytest.approx(2 ** (-2 / 3), abs=1e-3)
    assert (
        size(HiddenEffect("base_detachment", {"edge": "-y", "extent": 0.014}), ambiguity_map)
        is None
    )


def test_camera_pose_is_the_motion_that_a_diagnosis_fits() -> None:
    setup = Setup(geometry=Box(size=Scenario().size), tool=Tool(radius=5e-3))
    fitted = {"tx": 1e-3, "ty": -2e-3, "tz": 5e-4, "rx": 0.02, "ry": -0.01, "rz": 0.03}
    pose = camera_pose(CameraRegistration(**fitted).shift(setup), Scenario().size)
    assert pose == pytest.approx(fitted, abs=1e-12)


def test_cameras_size_is_of_its_whole_pose() -> None:
    limits = [{"parameter": f"t{axis}", "unit": "m", "change": 1e-3} for axis in "xyz"]
    limits += [{"parameter": f"r{axis}", "unit": "rad", "change": 0.02} for axis in "xyz"]
    hidden = HiddenEffect("camera_registration", {"translation": 3e-3, "rotation": 0.0})
    shift = Transform.from_vector(3e-3 * np.array([2.0, 1.0, 2.0]) / 3, np.zeros(3))
    assert size(hidden, row("camera_registration", *limits), shift) == pytest.approx(3.0, abs=1e-3)
    turned = Transform.from_vector(np.zeros(3), [0.0, 0.0, 0.04])
    assert size(hidden, row("camera_registration", *limits), turned) == pytest.approx(
        math.hypot(0.0, 2.0), abs=1e-3
    )
