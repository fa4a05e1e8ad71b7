"""One table of dataset.toml, which returns checked values; errors name key, value and bound."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import Any, cast

from palpate.dataset.files import problem
from palpate.foundation.errors import DatasetError, SetupError
from palpate.foundation.frames import Transform

__all__ = ["FILE", "Keys", "Vector", "nearest"]

FILE = "dataset.toml"
Vector = tuple[float, float, float]


def nearest(name: str, known: Iterable[str]) -> str:
    """Words that name the nearest known name, if any is near, and all known names."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=1)
    return (
        (f"did you mean '{close[0]}'? " if close else "") + "Known: " + (", ".join(known) or "none")
    )


class Keys:
    """One table of the file, which returns checked values; messages name its place."""

    def __init__(self, prefix: str, values: dict[str, Any]) -> None:
        self.prefix = prefix
        self.values = values

    def wrong(self, key: str, value: object, expected: str) -> DatasetError:
        """Make the error for a key whose value is not as expected."""
        shown = None if value is None else _shown(value)
        found = "" if shown is None else f" = {shown}"
        return problem(
            FILE,
            f"{self.prefix}{key}{found}; expected {expected}",
            key=self.prefix + key,
            value=shown,
        )

    def only(self, known: tuple[str, ...]) -> None:
        """Refuse keys other than the known ones."""
        for key in self.values:
            if key not in known:
                raise problem(
                    FILE,
                    f"{self.prefix}{key} is an unknown key; {nearest(key, known)}",
                    key=self.prefix + key,
                )

    def take(self, key: str) -> Any:
        """Return the value of a key that must be there."""
        if key not in self.values:
            raise problem(
                FILE,
                f"{self.prefix}{key} is missing; expected this key: add it",
                key=self.prefix + key,
            )
        return self.values[key]

    def table(self, key: str) -> Keys:
        """Return a table within this one."""
        value = self.take(key)
        if not isinstance(value, dict):
            raise self.wrong(key, value, f"a table: write [{key}] and its keys below it")
        return Keys(f"{self.prefix}{key}.", value)

    def text(self, key: str) -> str:
        """Return a printable text of at most 200 characters."""
        value = self.take(key)
        if (
            not isinstance(value, str)
            or not value.strip()
            or not value.isprintable()
            or len(value) > 200
        ):
            raise self.wrong(key, value, "a name in quotes: write one")
        return value

    def name(self, key: str) -> str:
        """Return a plain name, as of a file in the dataset."""
        value = self.text(key)
        if "/" in value or "\\" in value or value.startswith("."):
            raise self.wrong(key, value, "a plain name without slashes or a leading dot: rename it")
        return value

    def choice(self, key: str, only: str, why: str) -> str:
        """Return the only value that a key may have."""
        value = self.take(key)
        if value != only:
            raise self.wrong(key, value, f"'{only}': {why}")
        return only

    def number(
        self, key: str, low: float, high: float, unit: str, default: float | None = None
    ) -> float:
        """Return a number within bounds; the default, if there is one, for a missing key."""
        if default is not None and key not in self.values:
            return default
        return self.finite(key, self.take(key), low, high, unit)

    def vector(self, key: str, low: float, high: float, unit: str = "m") -> Vector:
        """Return three numbers within bounds."""
        value = self.take(key)
        if not isinstance(value, list) or len(value) != 3:
            words = " in metres" if unit == "m" else ""
            raise self.wrong(key, value, f"three numbers [x, y, z]{words}: write all three")
        return cast(
            Vector,
            tuple(self.finite(f"{key}[{i}]", one, low, high, unit) for i, one in enumerate(value)),
        )

    def names(self, key: str, kind: str = "sequences") -> tuple[str, ...]:
        """Return a list of names; an empty one for a missing key."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            raise self.wrong(key, value, f"a list of names of {kind} in quotes")
        return tuple(value)

    def finite(self, key: str, value: object, low: float, high: float, unit: str) -> float:
        """Return a value as a finite number within bounds."""
        span = f"a number from {low:g} to {high:g} {unit}".rstrip()
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.wrong(key, value, f"{span}: write it without quotes")
        number = float(value) if abs(value) < 1e300 else math.inf
        if not math.isfinite(number) or not low <= number <= high:
            raise self.wrong(key, value, span + _unit_hint(number, low, high, unit))
        return number

    def pose(self, key: str) -> Transform:
        """Return a rigid transform from a 4x4 matrix, row major."""
        rows = self.take(key)
        if (
            not isinstance(rows, list)
            or len(rows) != 4
            or any(not isinstance(row, list) or len(row) != 4 for row in rows)
        ):
            raise self.wrong(key, rows, "a 4x4 matrix, row major: four rows of four numbers")
        units = ("", "", "", "m")
        matrix = [
            [self.finite(f"{key}[{i}][{j}]", row[j], -10.0, 10.0, units[j]) for j in range(4)]
            for i, row in enumerate(rows)
        ]
        if matrix[3] != [0.0, 0.0, 0.0, 1.0]:
            expected = "0, 0, 0, 1 in the last row: write the matrix row by row"
            raise self.wrong(key, matrix[3], expected)
        try:
            return Transform.from_matrix(matrix)
        except SetupError:
            expected = (
                "a rotation in its upper left 3x3, right-handed and without scale: correct the "
                "signs and the unit"
            )
            raise self.wrong(key, matrix, expected) from None


def _shown(value: object) -> str:
    try:
        return f"{value!r:.80}"
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a number of thousands of digits"


def _unit_hint(value: float, low: float, high: float, unit: str) -> str:
    """Words that suggest another unit where a factor of 1000 brings the value into its bounds."""
    down, up = {"m": ("millimetres", ""), "kg": ("grams", ""), "Pa": ("", "kilopascals")}.get(
        unit, ("", "")
    )
    for name, factor in ((down, 1e-3), (up, 1e3)):
        if name and low <= value * factor <= high:
            return f": did you write {name}? That would be {value * factor:g} {unit}"
    return ": correct it"
