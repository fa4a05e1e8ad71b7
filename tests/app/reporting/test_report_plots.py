"""The error of each frame in a report that is one file: whole, whatever the order of the
sequences."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.app.reporting.report_plots import drawn_errors, error_plots, field_map
from palpate.app.storage.run_store import RecordedReplay


def _replay(name: str, worst: float) -> RecordedReplay:
    """Four frames, the third with the largest error [m], the last without a comparison."""
    raw = np.array([1e-4, 1e-4, worst, np.nan])
    return RecordedReplay(
        name,
        {
            "time": np.arange(4.0),
            "distance_raw": raw,
            "distance_extended": 0.5 * raw,
            "noise_floor": 1e-4,
        },
    )


@pytest.mark.parametrize("worst", [(2e-4, 9e-4, 3e-4), (9e-4, 2e-4, 3e-4)])
def test_no_curve_leaves_its_panel_and_all_have_one_scale(worst: tuple[float, ...]) -> None:
    drawn = drawn_errors(
        [_replay(f"poke-top-0{number}", size) for number, size in enumerate(worst, 1)], {}
    )
    limits = [axes.get_ylim() for axes in drawn.axes if axes.get_visible()]
    assert len(limits) == len(worst) and len(set(limits)) == 1
    assert limits[0][0] == 0.0 and 0.9 < limits[0][1] < 1.1


def test_panels_carry_name_and_split_and_nothing_is_drawn_of_nothing() -> None:
    assert "poke-top-01 (test)" in error_plots(
        [_replay("poke-top-01", 2e-4)], {"poke-top-01": "test"}
    )
    assert error_plots([], {}) == ""


def test_map_of_a_cast_is_drawn_from_three_sides_with_its_scale() -> None:
    rng = np.random.default_rng(0)
    places, offset = rng.uniform(-0.03, 0.03, (60, 3)), rng.normal(size=60) * 3e-4
    field = {"places": places.tolist(), "offset": offset.tolist()}
    drawn = field_map({"effect": "geometry_local", "parameters": {}, "field": field})
    assert all(text in drawn for text in ("from above", "from -y", "from +x", "cast over drawing"))
    assert drawn.count("<use") >= 3 * 60
    assert field_map({"effect": "gravity", "parameters": {}}) == ""
