"""Progress reports of long computations."""

from __future__ import annotations

from palpate.foundation.progress import part, rising


def test_part_maps_to_its_range_and_a_rising_report_never_falls() -> None:
    reports: list[tuple[float, str]] = []
    whole = rising(lambda fraction, text: reports.append((round(fraction, 6), text)))
    first = part(whole, 0.0, 0.8)
    for fraction, text in ((0.5, "fitting"), (1.0, "fitted")):
        first(fraction, text)
    first(0.6, "looking once more")
    whole(0.9, "recording")
    assert reports == [
        (0.4, "fitting"),
        (0.8, "fitted"),
        (0.8, "looking once more"),
        (0.9, "recording"),
    ]
