"""The sentence of a sweep names no value that its pushes do not show."""

from __future__ import annotations

from typing import Any

import pytest

from palpate.sweep.sweep_sentence import sweep_sentence


def direction(name: str, **others: Any) -> dict[str, Any]:
    plain = {
        "name": name, "values": [3e-3, 4e-3, 5e-3, 6e-3], "change": 2e-4, "flat": False,
        "little": False, "least": [3.9e-3, 4.4e-3], "edge": "",
    }  # fmt: skip
    return {**plain, **others}


def summary(*directions: dict[str, Any], low: float = 1e-5, **best: float) -> dict[str, Any]:
    return {
        "stated": 2.5e-4,
        "best": {"error": 1.8e-4, "number": 3, "values": best},
        "gain": {"value": 7e-5, "low": low, "high": 1e-4},
        "directions": list(directions),
    }


def said(*directions: dict[str, Any], low: float = 1e-5) -> str:
    values = {"tool_radius.radius": 4.2e-3, "poisson_ratio.nu": 0.332, "stiff_inclusion.x": 1e-3}
    found = summary(*directions, low=low)
    found["best"]["values"] = values
    return sweep_sentence(found).replace("\u00a0", " ")


def test_a_value_comes_with_its_interval_and_the_advice_to_diagnose() -> None:
    assert said(direction("tool_radius.radius")) == (
        "Least error 0.18 mm at tool radius 4.20 mm (3.9 to 4.4); 0.25 mm as stated. Other causes "
        "may lower the error as much: a diagnosis compares them."
    )


@pytest.mark.parametrize("how", [{"flat": True, "least": None}, {"little": True}])
def test_no_value_is_named_along_which_the_error_is_flat_or_changes_little(
    how: dict[str, Any],
) -> None:
    text = said(direction("poisson_ratio.nu", change=5e-6, **how))
    assert text == (
        "These clouds cannot tell poisson ratio: over the whole range the error changes by "
        "0.005 mm, from 0.18 mm."
    )
    both = said(direction("tool_radius.radius"), direction("poisson_ratio.nu", **how))
    assert "0.332" not in both and "cannot tell poisson ratio." in both


def test_a_gain_that_resampled_pushes_do_not_show_is_none() -> None:
    text = said(direction("tool_radius.radius"), low=-1e-6)
    assert "which drawing the pushes anew does not tell apart" in text
    assert "a diagnosis" not in text


def test_plateaus_and_edges_are_said() -> None:
    wide = said(direction("tool_radius.radius", least=[3.2e-3, 5.6e-3]))
    assert "tool radius anywhere from 3.2 to 5.6 mm" in wide
    edge = said(direction("stiff_inclusion.x", edge="low"))
    assert "at stiff inclusion x 1.00 mm" in edge
    assert "edge of the range of stiff inclusion x: widen it" in edge


def test_one_push_tells_nothing() -> None:
    assert "from one push" in said(direction("tool_radius.radius", flat=None, least=None))


def test_no_error_at_all_is_said() -> None:
    assert sweep_sentence({"best": None, "stated": None, "directions": []}) == (
        "No point has an error."
    )
