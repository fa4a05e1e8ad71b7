"""Progress reports of long computations: `report(fraction, text)`, which may raise `Cancelled`."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Report", "part", "rising", "silent"]

Report = Callable[[float, str], None]


def silent(fraction: float, text: str) -> None:
    """Discard a report."""


def part(report: Report, low: float, high: float) -> Report:
    """Map the fractions 0..1 of a part to `low`..`high` of the given report."""

    def scaled(fraction: float, text: str) -> None:
        report(low + (high - low) * fraction, text)

    return scaled


def rising(report: Report) -> Report:
    """Wrap a report so that its fraction never falls.

    A part that is repeated keeps the fraction the whole had reached.
    """
    most = 0.0

    def raised(fraction: float, text: str) -> None:
        nonlocal most
        most = max(most, fraction)
        report(most, text)

    return raised
