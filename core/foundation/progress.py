"""How a long computation tells where it is: `report(fraction, text)`, which may raise
`Cancelled`."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Report", "part", "rising", "silent"]

Report = Callable[[float, str], None]


def silent(fraction: float, text: str) -> None:
    """Report to nobody."""


def part(report: Report, low: float, high: float) -> Report:
    """A report whose 0..1 fills `low`..`high` of the given one."""

    def scaled(fraction: float, text: str) -> None:
        report(low + (high - low) * fraction, text)

    return scaled


def rising(report: Report) -> Report:
    """A report that never falls back: a part that is gone through again stays where the whole has
    come.
    """
    most = 0.0

    def held(fraction: float, text: str) -> None:
        nonlocal most
        most = max(most, fraction)
        report(most, text)

    return held
