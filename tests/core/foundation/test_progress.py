"""What a long computation tells of itself."""

from __future__ import annotations

from palpate.foundation.progress import part, rising


def test_part_fills_its_share_and_a_rising_report_never_falls_back() -> None:
    told: list[tuple[float, str]] = []
    whole = rising(lambda fraction, text: told.append((round(fraction, 6), text)))
    first = part(whole, 0.0, 0.8)
    for fraction, text in ((0.5, "fitting"), (1.0, "fitted")):
        first(fraction, text)
    first(0.6, "looking once more")
    whole(0.9, "recording")
    assert told == [
        (0.4, "fitting"),
        (0.8, "fitted"),
        (0.8, "looking once more"),
        (0.9, "recording"),
    ]
