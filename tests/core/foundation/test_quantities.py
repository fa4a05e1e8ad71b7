from __future__ import annotations

from typing import Any

import pytest

from palpate.foundation.quantities import NARROW, quantity, value_and_ends, with_interval


def _plain(text: str) -> str:
    return text.replace(NARROW, " ")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.000429871, "m", "0.43 mm"),
        (0.0151, "m", "15 mm"),
        (0.083, "s", "83 ms"),
        (0.0349, "rad", "2.0°"),
        (6.04, "1", "6.0"),
        ("-x", "", "-x"),
    ],
)
def test_quantities_have_the_unit_people_read_and_two_digits(
    value: Any, unit: str, text: str
) -> None:
    assert _plain(quantity(value, unit)) == text


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "text"),
    [
        (0.0038, 0.003632, 0.003962, "m", "3.80 mm (3.63 to 3.96)"),
        (1.043, 1.038, 1.0481, "1", "1.043 (1.038 to 1.048)"),
        (-0.01043, -0.01071, -0.01012, "m", "-10.43 mm (-10.71 to -10.12)"),
        (5100.0, 4400.0, 6100.0, "Pa", "5.1 kPa (4.4 to 6.1)"),
        (0.0, -0.0001, 0.0001, "m", "0.00 mm (-0.10 to 0.10)"),
        (-4e-9, -0.0087, 0.0087, "m", "0 mm (-9 to 9)"),
        (0.0349, 0.031, 0.039, "rad", "2.00° (1.78° to 2.23°)"),
    ],
)
def test_interval_has_as_many_decimals_as_tell_its_ends_apart(
    value: float, low: float, high: float, unit: str, text: str
) -> None:
    assert _plain(with_interval({"value": value, "low": low, "high": high, "unit": unit})) == text


def test_value_without_an_interval_stands_alone() -> None:
    assert _plain(with_interval({"value": 0.0034, "unit": "m"})) == "3.40 mm"
    assert with_interval({"value": "-x", "unit": ""}) == "-x"


def test_value_without_bounds_is_said_and_no_error() -> None:
    assert value_and_ends(
        {"value": float("inf"), "low": 2.0, "high": float("inf"), "unit": "1"}
    ) == ("inf", "2", "")


def test_open_end_is_left_empty_and_the_other_told() -> None:
    assert value_and_ends({"value": 3.2, "low": 2.1, "high": None, "unit": "1"}) == (
        "3.20",
        "2.10",
        "",
    )
