from __future__ import annotations

import numpy as np
import pytest

from palpate.app.drawing.colours import BANDS, SIGNED, band_of, nice_limit


def test_zero_lies_in_the_middle_band_and_the_bands_are_symmetric() -> None:
    errors = np.linspace(-1.2e-3, 1.2e-3, 601)
    bands = band_of(errors, 1e-3)
    assert band_of(np.array([0.0]), 1e-3)[0] == BANDS // 2
    inside = ~np.isclose((errors / 1e-3 + 1) * BANDS / 2 % 1, 0)
    np.testing.assert_array_equal((bands + bands[::-1])[inside], BANDS - 1)


def test_errors_beyond_the_scale_take_its_end_and_unseen_ones_their_own_colour() -> None:
    np.testing.assert_array_equal(
        band_of(np.array([-5.0, 5.0, np.nan]), 1e-3), [0, BANDS - 1, BANDS]
    )


def test_signed_map_is_light_in_the_middle_and_dark_at_both_ends() -> None:
    lightness = np.array(SIGNED) @ [0.2126, 0.7152, 0.0722]
    assert lightness.argmax() == BANDS // 2
    assert np.all(np.diff(lightness[: BANDS // 2 + 1]) > 0)
    assert np.all(np.diff(lightness[BANDS // 2 :]) < 0)


@pytest.mark.parametrize(("spread", "limit"), [(0.00083, 0.0008), (0.0021, 0.002), (0.0105, 0.01)])
def test_automatic_scale_holds_95_percent_and_is_round(spread: float, limit: float) -> None:
    errors = np.append(np.linspace(-spread, spread, 1001), [np.nan, 0.5])
    assert nice_limit(errors) == pytest.approx(limit)
    assert np.mean(np.abs(errors[:-2]) <= limit) >= 0.95


def test_automatic_scale_of_nothing_seen_is_a_millimetre() -> None:
    assert nice_limit(np.full(4, np.nan)) == pytest.approx(1e-3)
