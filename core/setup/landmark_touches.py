"""The touches and traces that related robot and phantom, and their possible errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from palpate.foundation.errors import SetupError
from palpate.setup.bounds import require_within

__all__ = ["PAIRINGS", "Touching", "Tracing"]

PAIRINGS = (
    "as-paired",
    "swap-1-2",
    "swap-1-3",
    "swap-1-4",
    "swap-2-3",
    "swap-2-4",
    "swap-3-4",
    "turn-1",
    "turn-2",
    "turn-3",
    "reversed",
)
"""Possible true pairings of touches with landmarks: as stated, two rows of touches.csv exchanged,
each touch with the landmark so many rows further on (cyclic), or all in the reverse order."""


@dataclass(frozen=True, kw_only=True)
class Touching:
    """The landmark touches from which phantom_from_robot was computed.

    Attributes:
        misses: (x, y, z) [m] of each touch minus its landmark under the stated registration,
            phantom frame; empty if no touch is off.
        lift: height of the tool's centre over the landmark at a touch [m]; with `normals` the
            stated radius of the ball, which rests on the surface.
        normals: outward unit normal at each landmark, along which the ball's centre lies; empty for
            a lift along z.
        pairing: the true pairing of touches with landmarks, one of PAIRINGS.
        scale: size of the touched polygon over that of the landmarks [1].
        inset: distance of each touch inwards from its landmark, along x and along y [m]: a ball
            does not stay on a corner.
        deviation: standard deviation of one coordinate of a touch [m]; None if nothing tells it.
    """

    misses: tuple[tuple[float, float, float], ...] = ()
    lift: float = 0.0
    normals: tuple[tuple[float, float, float], ...] = ()
    pairing: str = "as-paired"
    scale: float = 1.0
    inset: float = 0.0
    deviation: float | None = None

    def __post_init__(self) -> None:
        if self.pairing not in PAIRINGS:
            raise SetupError(
                f"pairing = {self.pairing!r} is none of {', '.join(PAIRINGS)}",
                key="pairing",
                value=self.pairing,
            )
        require_within("touching scale", self.scale, 0.1, 10.0, "")

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, SI units.

        An unknown deviation and normals are left out where there are none: setups stored before
        there were any have none.
        """
        values = {key: value for key, value in vars(self).items() if value not in (None, ())}
        values["misses"] = [list(miss) for miss in self.misses]
        if self.normals:
            values["normals"] = [list(normal) for normal in self.normals]
        return values

    def order(self, count: int) -> list[int]:
        """The landmark, by its row, that each of `count` touches truly belongs to.

        Raises SetupError if there are too few touches for the pairing.
        """
        order, (kind, *words) = list(range(count)), self.pairing.split("-")
        if kind == "as":
            return order
        if kind == "reversed":
            return order[::-1]
        rows = [int(word) for word in words]
        if max(rows) > count - (kind == "turn"):
            raise SetupError(
                f"pairing {self.pairing!r} needs more than {count} touches",
                key="pairing",
                value=self.pairing,
            )
        if kind == "turn":
            return order[rows[0] :] + order[: rows[0]]
        first, second = (row - 1 for row in rows)
        order[first], order[second] = second, first
        return order


@dataclass(frozen=True, kw_only=True)
class Tracing:
    """The traces from which phantom_from_robot was computed.

    Attributes:
        centres: (x, y, z) [m] of the ball on the surface under the stated registration, phantom
            frame.
        radius: of the ball, as stated [m].
    """

    centres: tuple[tuple[float, float, float], ...]
    radius: float
