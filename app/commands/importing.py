"""`palpate import`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from palpate.app.commands.console import out, print_warnings, progress
from palpate.app.commands.data import check
from palpate.foundation.errors import DatasetError

if TYPE_CHECKING:
    from palpate.importing.import_notes import ImportNotes
    from palpate.importing.recording import Recording
    from palpate.importing.rules import ImportMapping
    from palpate.importing.tables.table_preview import TablePreview

__all__ = ["delay_text", "import_"]

OTHER_CLOCK = 1.0
"""Delay between stamp and receipt that no delivery takes [s]."""


def import_(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Bags, folders of bags, tables, folders of clouds, touches.csv, dataset.toml.",
            show_default=False,
        ),
    ] = None,
    to: Annotated[
        Path | None, typer.Option(help="Folder of the new dataset.", show_default=False)
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(
            help="import.toml: read where it exists, otherwise written with the proposal.",
            show_default=False,
        ),
    ] = None,
    setup: Annotated[
        Path | None,
        typer.Option(
            help="A dataset.toml with phantom, tool, landmarks and camera.", show_default=False
        ),
    ] = None,
    pose: Annotated[str, typer.Option(help="Stream of the tool's poses.")] = "",
    cloud: Annotated[str, typer.Option(help="Stream of clouds or depth images.")] = "",
    wrench: Annotated[str, typer.Option(help="Stream of forces.")] = "",
    preset: Annotated[
        str, typer.Option(help="Layout of the recordings; by their look unless named, or none.")
    ] = "",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print streams and mapping, write no dataset.")
    ] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Replace the dataset of an earlier import.")
    ] = False,
) -> None:
    """Turn recordings of a bench into a checked dataset.

    Without --to, print the streams and the proposed mapping.
    """
    from palpate.importing.import_notes import ImportNotes
    from palpate.importing.import_recording import import_recordings
    from palpate.importing.mapping_file import read_mapping

    notes = ImportNotes()
    if mapping is not None and mapping.exists():
        if files or setup or pose or cloud or wrench or preset:
            raise DatasetError(
                f"{mapping} states the recordings already; expected it alone: leave out the files "
                "and options, or name another mapping",
                file=str(mapping),
            )
        chosen, base = read_mapping(mapping), mapping.resolve().parent
    else:
        named = pose, cloud, wrench
        chosen, base = _proposed(files or [], to, setup, named, preset, notes), Path.cwd()
        _write_proposal(mapping, chosen)
    if to is None or dry_run:
        _print_notes(notes)
        _print_mapping(chosen, shown=mapping is None)
        return
    with progress(f"import {to.name}") as report:
        done = import_recordings(chosen, base, to.resolve(), notes, report, again)
    _print_notes(notes)
    if done.reused:
        out.print(f"unchanged, taken over: {', '.join(done.reused)}", highlight=False)
    out.print(f"dataset: {escape(str(to))}", highlight=False)
    check([to])


def _proposed(
    files: list[Path],
    to: Path | None,
    setup: Path | None,
    named: tuple[str, str, str],
    preset: str,
    notes: ImportNotes,
) -> ImportMapping:
    from palpate.importing.survey import survey

    if not files:
        raise DatasetError("no file is named; expected recordings, or --mapping import.toml")
    found = survey(files, setup, preset)
    try:
        for role, stream in zip(("pose", "cloud", "wrench"), named, strict=True):
            if stream:
                found.topics[role] = stream
        for recording in found.recordings:
            _print_streams(recording)
        proposal = found.proposal(to.name if to is not None else "imported", notes)
        for recording in found.recordings:
            for preview in recording.previews():
                _print_preview(preview)
        return proposal
    finally:
        found.close()


def _write_proposal(path: Path | None, mapping: ImportMapping) -> None:
    from palpate.importing.mapping_file import mapping_text

    if path is not None:
        path.write_text(mapping_text(mapping), encoding="utf-8")
        out.print(f"mapping: {escape(str(path))}", highlight=False)


def _print_streams(recording: Recording) -> None:
    title = f"{recording.name}: {', '.join(source.path.name for source in recording.sources)}"
    table = Table(
        title=escape(title), header_style="bold", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    for column in ("stream", "kind", "type", "samples", "rate", "delay", "frame"):
        right = column in ("samples", "rate", "delay")
        table.add_column(column, justify="right" if right else "left", overflow="fold")
    for one in recording.streams():
        rate = f"{one.rate:.1f} Hz" if 0 < one.rate < 1e6 else "–"
        table.add_row(
            escape(one.name), one.kind, one.message_type, str(one.count), rate,
            delay_text(one.delay),
            escape(", ".join(one.frames)),
        )  # fmt: skip
    out.print(table)
    for one in recording.streams():
        if one.delay is not None and abs(one.delay) > OTHER_CLOCK:
            print_warnings(
                [
                    f"{one.name}: its header stamps are {one.delay:.1f} s before their receipt: "
                    "another clock, or a time that was never set"
                ]
            )


def _print_preview(preview: TablePreview) -> None:
    """Print the first rows of a table in SI units, below the names of its columns."""
    table = Table(
        title=escape(f"{preview.file}: first of {preview.rows} rows, as they are understood"),
        header_style="bold", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False,
    )  # fmt: skip
    for name in ("quantity", "column", "written in", "first rows"):
        table.add_column(name, overflow="fold")
    for one in preview.columns:
        unit = f" [{one.unit}]" if one.unit else ""
        row = (f"{one.quantity}{unit}", one.column, one.written or "–", ", ".join(one.values))
        table.add_row(*(escape(cell) for cell in row))
    out.print(table)
    if preview.unused:
        names = escape(", ".join(preview.unused)[:200])
        out.print(f"not used: {names}", highlight=False)


def delay_text(seconds: float | None) -> str:
    """Delay between stamp and receipt, in words."""
    if seconds is None:
        return "–"
    return "other clock" if abs(seconds) > OTHER_CLOCK else f"{1e3 * seconds:.1f} ms"


def _print_notes(notes: ImportNotes) -> None:
    for decision in notes.decisions:
        out.print(f"[green]decided[/] {escape(decision)}", highlight=False, soft_wrap=True)
    print_warnings(notes.warnings)


def _print_mapping(mapping: ImportMapping, shown: bool) -> None:
    from palpate.importing.mapping_file import mapping_text

    if shown:
        out.print(escape(mapping_text(mapping)), highlight=False, soft_wrap=True)
