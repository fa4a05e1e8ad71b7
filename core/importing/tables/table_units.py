"""Units of a table's columns, and its stamps in whole nanoseconds."""

from __future__ import annotations

from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.tables.table_text import TextTable

__all__ = ["METRES", "NANOSECONDS", "NEWTONS", "received_stamps", "row_stamps"]

NANOSECONDS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
NEWTONS = {"N": 1.0, "mN": 1e-3}


def row_stamps(table: TextTable, rules: ColumnRules) -> list[int]:
    """Stamps of the rows [ns]; whole numbers stay exact.

    Raises DatasetError without a column of times.
    """
    column = rules.columns.get("t") or rules.columns.get("received")
    if column is None:
        raise DatasetError(
            f"{table.file} has no column of times; expected t: name it in its table of columns",
            file=table.file,
            key="t",
        )
    if rules.time_unit == "s+ns":
        seconds, nanoseconds = (_whole(table, one) for one in column.split("+"))
        return [10**9 * s + ns for s, ns in zip(seconds, nanoseconds, strict=True)]
    return _stamps(table, column, NANOSECONDS[rules.time_unit])


def received_stamps(table: TextTable, rules: ColumnRules) -> list[int]:
    """Times of receipt [ns], in the unit of t."""
    return _stamps(table, rules.columns["received"], NANOSECONDS.get(rules.time_unit, 10**9))


def _stamps(table: TextTable, column: str, unit: int) -> list[int]:
    whole = table.whole(column)
    return _exact(table, column, unit) if whole is None else [unit * one for one in whole]


def _whole(table: TextTable, column: str) -> list[int]:
    whole = table.whole(column)
    if whole is None:
        raise DatasetError(
            f"{table.file}: {column} is not whole everywhere; expected whole numbers of seconds "
            "and nanoseconds",
            file=table.file,
            key=column,
        )
    return whole


def _exact(table: TextTable, column: str, unit: int) -> list[int]:
    """Decimal times in whole nanoseconds, without rounding of a double."""
    times = table.numbers(column)
    stamps = []
    for text, number in zip(table.texts(column), times.tolist(), strict=True):
        whole, point, rest = text.strip().replace(",", ".").partition(".")
        if point and rest.isdecimal() and whole.lstrip("+-").isdecimal():
            part = int(rest) * unit / 10 ** len(rest)
            stamps.append(int(whole) * unit + round(-part if whole.startswith("-") else part))
        else:
            stamps.append(round(number * unit))
    return stamps
