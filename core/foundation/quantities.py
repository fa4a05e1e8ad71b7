"""Numbers with units and a sensible number of digits."""

from __future__ import annotations

import math
from typing import Any

__all__ = [
    "NARROW",
    "SHOWN",
    "parameter_texts",
    "parameters_text",
    "quantity",
    "value_and_ends",
    "with_interval",
    "words",
]

NARROW = "\N{NO-BREAK SPACE}"
SHOWN = {
    "m": (1e3, "mm"),
    "Pa": (1e-3, "kPa"),
    "s": (1e3, "ms"),
    "rad": (180.0 / math.pi, "°"),
    "1/m": (1.0, "/m"),
    "1": (1.0, ""),
    "": (1.0, ""),
}


def quantity(value: Any, unit: str, digits: int = 2) -> str:
    """A number in a convenient unit with sensible digits: 0.00043 m is 0.43 mm."""
    if not isinstance(value, (int, float)):
        return str(value)
    factor, shown = SHOWN.get(unit, (1.0, unit))
    scaled = float(f"{float(value) * factor:.{digits}g}")
    places = (
        max(0, digits - 1 - math.floor(math.log10(abs(scaled))))
        if scaled and math.isfinite(scaled)
        else 0
    )
    return _with_unit(f"{scaled:.{min(places, 4)}f}", shown)


def _with_unit(text: str, shown: str) -> str:
    return f"{text}{'' if shown in ('', '°') else NARROW}{shown}"


def value_and_ends(entry: dict[str, Any]) -> tuple[str, str, str]:
    """Value, low and high end of a report's parameter, with the decimals that distinguish the ends:
    1.043, 1.038, 1.048.

    At least two digits of the interval's width and of the value; only of the width for a value that
    is small against it. An unknown end is an empty text.
    """
    value, unit = entry["value"], entry.get("unit", "1")
    if not isinstance(value, (int, float)):
        return str(value), "", ""
    factor, shown = SHOWN.get(unit, (1.0, unit))
    low, high = (
        end if isinstance(end, (int, float)) and math.isfinite(end) else None
        for end in map(entry.get, ("low", "high"))
    )
    width = abs(value) / 5 if low is None or high is None else high - low
    sizes = (abs(value) if abs(value) > width / 100 else 0.0, width)
    places = max(
        (1 - math.floor(math.log10(size * factor)) for size in sizes if 0 < size < math.inf),
        default=0,
    )

    def shown_with_unit(number: float | None) -> str:
        return (
            ""
            if number is None
            else _with_unit(f"{number * factor:z.{min(4, max(0, places))}f}", shown)
        )

    return shown_with_unit(value), shown_with_unit(low), shown_with_unit(high)


def with_interval(entry: dict[str, Any]) -> str:
    """A parameter of a report with its interval, as 5.1 kPa (4.8 to 5.4); only the value without
    one.
    """
    value, low, high = value_and_ends(entry)
    return f"{value} ({low.split(NARROW)[0]} to {high.split(NARROW)[0]})" if low and high else value


def parameter_texts(cause: dict[str, Any]) -> list[str]:
    """Each parameter of a cause or of a hidden effect with its interval: `radius 4.2 mm (4.1 to
    4.3)`.
    """
    return [f"{name} {with_interval(entry)}" for name, entry in cause.get("parameters", {}).items()]


def parameters_text(cause: dict[str, Any]) -> str:
    """All parameters of a cause or of a hidden effect, separated by commas."""
    return ", ".join(parameter_texts(cause))


def words(name: str) -> str:
    """The name of an effect or parameter as plain text."""
    return name.replace("_", " ")
