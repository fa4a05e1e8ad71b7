"""`palpate look`."""

from __future__ import annotations

import secrets
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from palpate.app.commands.console import out, print_warnings, progress
from palpate.app.commands.importing import delay_text
from palpate.app.commands.service import announce
from palpate.app.settings import Settings
from palpate.foundation.errors import DatasetError, SetupError

__all__ = ["look"]


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
            f"{row['rate']:.1f} Hz" if row["rate"] else "–", delay_text(row["delay"]),
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
