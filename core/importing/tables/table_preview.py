"""The first rows of a table as they are understood: quantities with units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.tables.table_rotation import ANGLES, NAMED, ORDERED, row_quaternions
from palpate.importing.tables.table_text import TextTable
from palpate.importing.tables.table_units import METRES, NEWTONS, row_stamps

__all__ = ["PreviewColumn", "TablePreview", "preview_of"]


@dataclass(frozen=True, kw_only=True)
class PreviewColumn:
    """One quantity of a table.

    Attributes:
        quantity: as in the rules of columns; the rotation is the four components qx to qw.
        column: its name in the file; several are joined by a comma.
        written: unit in the file; empty where it has none.
        unit: of the values.
        values: of the first rows, in words.
    """

    quantity: str
    column: str
    written: str
    unit: str
    values: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class TablePreview:
    """The first rows of one table.

    Attributes:
        file: name of the table.
        rows: number of all its rows.
        columns: that are understood, in SI units.
        unused: names of the columns that are not.
        questions: sentences on what is taken by size only, or open.
    """

    file: str
    rows: int
    columns: tuple[PreviewColumn, ...]
    unused: tuple[str, ...]
    questions: tuple[str, ...]


def preview_of(
    table: TextTable, rules: ColumnRules, questions: Iterable[str], rows: int
) -> TablePreview:
    """Read the first rows of a table by its rules."""
    head = table.head(rows)
    columns = tuple(_columns(head, rules))
    used = {part for one in columns for part in (one.column, *one.column.split(", "))}
    used |= {part for column in rules.columns.values() for part in column.split("+")}
    unused = tuple(name for name in table.columns if name not in used)
    return TablePreview(
        file=table.file, rows=len(table), columns=columns, unused=unused, questions=tuple(questions)
    )


def _columns(head: TextTable, rules: ColumnRules) -> Iterator[PreviewColumn]:
    known = rules.columns
    if "t" in known or "received" in known:
        stamps = row_stamps(head, rules)
        yield PreviewColumn(
            quantity="t",
            column=known.get("t") or known["received"],
            written=rules.time_unit,
            unit="s",
            values=tuple(f"{stamp / 1e9:.6f}" for stamp in stamps),
        )
    for axes, written, unit, factor in (
        ("x y z", rules.length_unit, "m", METRES[rules.length_unit]),
        ("nx ny nz", "", "", 1.0),
        ("fx fy fz", rules.force_unit, "N", NEWTONS[rules.force_unit]),
    ):
        for axis in axes.split():
            if axis in known:
                yield PreviewColumn(
                    quantity=axis,
                    column=known[axis],
                    written=written,
                    unit=unit,
                    values=tuple(f"{factor * one:.6g}" for one in head.numbers(known[axis])),
                )
    yield from _rotation(head, rules)
    for name in ("push", "file"):
        if name in known:
            yield PreviewColumn(
                quantity=name,
                column=known[name],
                written="",
                unit="",
                values=tuple(head.texts(known[name])),
            )


def _rotation(head: TextTable, rules: ColumnRules) -> Iterator[PreviewColumn]:
    """The rotation as quaternions, or as it stands while its reading is open."""
    for parts in (NAMED, ORDERED, ANGLES):
        if not all(part in rules.columns for part in parts):
            continue
        try:
            turns = row_quaternions(head, rules)
        except DatasetError:
            for part in parts:
                texts = tuple(head.texts(rules.columns[part]))
                yield PreviewColumn(
                    quantity=f"{part}, reading open",
                    column=rules.columns[part],
                    written="",
                    unit="",
                    values=texts,
                )
            return
        columns = ", ".join(rules.columns[part] for part in parts)
        written = rules.angle_unit if parts == ANGLES and rules.rotation != "quaternion" else ""
        kind = f"{rules.rotation} " if parts == ANGLES else ""
        for name, values in zip(NAMED, turns.T, strict=True):
            yield PreviewColumn(
                quantity=name,
                column=columns,
                written=f"{kind}{written}".strip(),
                unit="",
                values=tuple(f"{value:.4f}" for value in values),
            )
        return
