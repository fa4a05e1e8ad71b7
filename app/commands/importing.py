"""`palpate import` and `palpate look`."""

from __future__ import annotations

import secrets
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from palpate.app.commands.console import out, print_warnings, progress
from palpate.app.commands.data import check
from palpate.app.commands.service import announce
from palpate.app.settings import Settings
from palpate.foundation.errors import DatasetError, SetupError

if TYPE_CHECKING:
    from palpate.importing.import_notes import ImportNotes
    from palpate.importing.recording import Recording
    from palpate.importing.rules import ImportMapping
    from palpate.importing.tables.table_preview import TablePreview

__all__ = ["import_", "look"]

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


def look(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Bags, folders of bags, tables, folders of clouds; or the folder of a dataset.",
            show_default=False,
        ),
    ] = None,
    setup: Annotated[
        Path | None,
        typer.Option(help="A dataset.toml with the phantom and the tool.", show_default=False),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(help="An import.toml: streams, columns, sequences.", show_default=False),
    ] = None,
    runs: Annotated[Path, typer.Option(help="Folder in which looks are stored.")] = Path("runs"),
    datasets: Annotated[Path, typer.Option(help="Folder of the datasets.")] = Path("datasets"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes a free one.")] = 8321,
    show: Annotated[
        bool, typer.Option("--serve/--no-serve", help="Open the page, or only print and keep none.")
    ] = True,
) -> None:
    """Look at recordings or a dataset before any job: streams, gaps, sequences, warnings."""
    chosen = list(files or [])
    if not chosen and mapping is None:
        raise DatasetError("no file is named; expected recordings, a dataset, or --mapping")
    with tempfile.TemporaryDirectory() as aside:
        home = runs if show else Path(aside)
        found = _looked(chosen, setup, mapping, home)
        _print_look(found)
    if show:
        _serve_look(found["id"], Settings(port=port, runs=runs, datasets=datasets))


def _looked(
    files: list[Path], setup: Path | None, mapping: Path | None, runs: Path
) -> dict[str, Any]:
    """Take a look and store it below `runs`; its content with its `id`."""
    from palpate.app.jobs.look_jobs import look as take
    from palpate.app.storage.look_store import LookStore
    from palpate.first_look.look_request import named_files
    from palpate.importing.mapping_file import mapping_text

    text = None
    if mapping is not None:
        stated, own = named_files(mapping)
        text, files = mapping_text(stated), files or own
    identity = f"look-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(4)}"
    request: dict[str, Any] = {
        "files": [str(file.resolve()) for file in files],
        "setup": None if setup is None else _text_of(setup),
        "mapping": text,
        "runs": str(runs),
        "most": 0,
        "name": files[0].resolve().stem,
    }
    request["sent"] = {key: request[key] for key in ("files", "setup", "mapping", "name")}
    runs.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(dir=runs, prefix=".looking-") as scratch,
        progress(f"look {request['name']}") as report,
    ):
        take({**request, "scratch": str(Path(scratch) / identity)}, report)
    return {**LookStore(runs).files(identity).look(), "id": identity}


def _text_of(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(
            f"{file} cannot be read ({error}); expected a dataset.toml", file=str(file)
        ) from None


def _serve_look(identity: str, settings: Settings) -> None:
    """Serve the page on a look; where a server works on these runs already, say where it shows."""
    from palpate.app.main import create_app
    from palpate.app.server.serve import serve

    path = f"/?look={identity}"
    try:
        serve(
            create_app(settings),
            settings.host,
            settings.port,
            lambda address: announce(address, path),
        )
    except SetupError as error:
        if "another server works" not in error.message:
            raise
        out.print(
            f"a server works in {escape(str(settings.runs))} already: open [bold]{path}[/] there",
            highlight=False,
        )


def _print_look(found: dict[str, Any]) -> None:
    """Print streams and sequences of each recording, then what was decided and what is doubtful."""
    recordings = found["recordings"]
    if len(recordings) > 1:
        out.print(_recordings_of(found))
    for one in recordings[:1]:
        out.print(_streams_of(one))
    for one in recordings if len(recordings) == 1 else ():
        if one["sequences"]:
            out.print(_sequences_of(one))
    for decision in found["decisions"]:
        out.print(f"[green]decided[/] {escape(decision)}", highlight=False, soft_wrap=True)
    print_warnings(found["warnings"])
    if found["error"]:
        out.print(f"[red]missing[/] {escape(found['error']['message'])}", highlight=False)


def _recordings_of(found: dict[str, Any]) -> Table:
    """One row for each recording: its length, clouds, deepest push, gaps and faults."""
    table = _table(
        f"{found['source']['name']}: {len(found['recordings'])} recordings",
        ("recording", "split"),
        ("length", "clouds", "deepest", "gaps", "faults"),
    )
    for one in found["recordings"]:
        depth = one["tool"]["depth"]
        splits = dict.fromkeys(window["split"] for window in one["sequences"])
        gaps, faults = (sum(len(row[key]) for row in one["streams"]) for key in ("gaps", "faults"))
        table.add_row(
            escape(one["name"]), ", ".join(splits) or "–", f"{one['end'] - one['start']:.1f} s",
            str(len(one["clouds"]["t"])), f"{1e3 * max(depth):.1f} mm" if depth else "–",
            str(gaps or "–"), str(faults or "–"),
        )  # fmt: skip
    return table


def _streams_of(one: dict[str, Any]) -> Table:
    table = _table(
        f"{one['name']}: {one['end'] - one['start']:.1f} s, {len(one['clouds']['t'])} clouds",
        ("stream", "taken as"),
        ("samples", "rate", "delay", "gaps", "longest", "faults"),
    )
    for row in one["streams"]:
        gaps = [end - start for start, end in row["gaps"]]
        table.add_row(
            escape(row["name"]), row["role"] or "–", str(row["samples"]),
            f"{row['rate']:.1f} Hz" if row["rate"] else "–", _delay(row["delay"]),
            str(len(gaps) or "–"), f"{max(gaps):.2f} s" if gaps else "–",
            str(len(row["faults"]) or "–"),
        )  # fmt: skip
    return table


def _sequences_of(one: dict[str, Any]) -> Table:
    table = _table("sequences", ("name", "kind", "split"), ("start", "end"))
    for row in one["sequences"]:
        ends = (f"{row[key] - one['start']:.2f} s" for key in ("start", "end"))
        table.add_row(escape(row["name"]), row["kind"] or "–", row["split"], *ends)
    return table


def _table(title: str, texts: tuple[str, ...], numbers: tuple[str, ...]) -> Table:
    """An empty table with columns of texts, then of numbers."""
    table = Table(
        title=escape(title), header_style="bold", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    for column in texts:
        table.add_column(column, overflow="fold")
    for column in numbers:
        table.add_column(column, justify="right")
    return table


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
            _delay(one.delay),
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


def _delay(seconds: float | None) -> str:
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
