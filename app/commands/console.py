"""Output that all commands share: progress, warnings, errors and verdicts."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from palpate.app.jobs.signals import stop
from palpate.foundation.errors import Cancelled, PalpateError
from palpate.foundation.progress import Report
from palpate.foundation.quantities import parameter_texts

__all__ = [
    "DatasetFolder",
    "DatasetFolders",
    "RegistrationOption",
    "as_tables",
    "errors",
    "out",
    "print_problem",
    "print_serve_command",
    "print_warnings",
    "progress",
    "verdict_cells",
    "verdict_table",
    "write_json",
]

RegistrationOption = Annotated[
    str | None,
    typer.Option(
        help="Accepted registration of the camera: a name stored for this dataset, or a file; "
        "automatic if omitted."
    ),
]
"""The option by which verbs take an accepted registration."""


def as_tables(folder: Path) -> Path:
    """The folder of a dataset, or that of its import where its sequences are bags."""
    if not (folder / "sequences").is_dir():
        return folder
    from palpate.importing.import_notes import ImportNotes
    from palpate.importing.opened_bags import folder_of_tables, has_bags

    if not has_bags(folder):
        return folder
    notes = ImportNotes()
    with progress(f"import the bags of {folder.name}") as report:
        opened = folder_of_tables(folder, notes, report)
    print_warnings(notes.warnings)
    errors.print(f"bags of {escape(str(folder))}: opened as {escape(str(opened))}", style="dim")
    return opened


DatasetFolder = Annotated[
    Path, typer.Argument(help="A dataset folder.", show_default=False, callback=as_tables)
]
"""The argument of verbs that read one dataset, with tables or with bags."""
DatasetFolders = Annotated[
    list[Path],
    typer.Argument(
        help="Dataset folders.",
        show_default=False,
        callback=lambda folders: [as_tables(one) for one in folders],
    ),
]
"""The argument of verbs that read several."""

BETWEEN_LINES = 30.0
"""Least time between two lines of progress in a log [s]."""

out = Console()
errors = Console(stderr=True)


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show a progress bar on the error channel, so that the output can be piped; lines in a log."""
    shown = _bar(title) if errors.is_terminal else _lines(title)
    with shown as show:

        def report(fraction: float, text: str) -> None:
            if stop.received:
                raise Cancelled
            show(min(1.0, fraction), text)

        yield report


@contextmanager
def _bar(title: str) -> Iterator[Report]:
    columns = (
        TextColumn("[bold]{task.fields[title]}"),
        BarColumn(bar_width=28),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("[dim]{task.description}", markup=True),
    )
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task("", total=1.0, title=title)
        yield lambda fraction, text: bar.update(task, completed=fraction, description=escape(text))


@contextmanager
def _lines(title: str) -> Iterator[Report]:
    """Print the progress at most twice a minute."""
    began = last = time.monotonic()

    def show(fraction: float, text: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= BETWEEN_LINES:
            last = now
            errors.print(
                f"{title}: {100 * fraction:.0f} % after {now - began:.0f} s, {text}",
                highlight=False,
                markup=False,
                soft_wrap=True,
            )

    yield show


def print_serve_command(folder: Path) -> None:
    """Print the command that shows the runs and datasets of a folder."""
    look = f"{sys.argv[0]} serve --runs {folder / 'runs'} --datasets {folder / 'datasets'}"
    out.print(f"to look at it: [bold]{escape(look)}[/]", highlight=False, soft_wrap=True)


def verdict_table(with_truth: bool, title: str | None = None) -> Table:
    """An empty table of verdicts; "removed" is the share of the reducible error that the causes
    remove.
    """
    table = Table(
        title=title,
        header_style="bold",
        box=SIMPLE,
        padding=(0, 1, 0, 0),
        pad_edge=False,
        show_lines=False,
    )
    for name in ("dataset", "verdict", "cause"):
        table.add_column(name, overflow="fold")
    table.add_column("removed", justify="right")
    table.add_column("time", justify="right")
    if with_truth:
        table.add_column("truth", overflow="fold")
        table.add_column("")
    return table


def verdict_cells(
    name: str,
    report: dict[str, Any],
    seconds: float,
    truth: dict[str, Any] | None,
    with_truth: bool,
) -> list[str]:
    """One row of that table."""
    causes = report.get("causes", [])
    cells = [
        name,
        str(report.get("verdict")),
        _causes(causes) or "–",
        _removed(report),
        f"{seconds:.0f} s",
    ]
    if not with_truth:
        return cells
    if truth is None:
        return [*cells, "unknown", ""]
    return [
        *cells,
        _causes(truth["effects"]) or "none",
        "[green]✓[/]" if agrees(report, truth) else "[red]✗[/]",
    ]


def agrees(report: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether verdict and causes are the true ones, in any order."""
    named = {cause["effect"] for cause in report.get("causes", [])}
    return report.get("verdict") == truth["verdict"] and named == {
        one["effect"] for one in truth["effects"]
    }


def print_warnings(warnings: Sequence[str]) -> None:
    """Print warnings, one on a line."""
    for warning in warnings:
        out.print(f"[yellow]warning[/] {escape(warning)}", highlight=False)


def print_problem(error: PalpateError, place: str = "") -> None:
    """Print an error on the error channel."""
    errors.print(
        f"[bold red]{type(error).__name__}[/]{escape(place)}: {escape(error.message)}",
        soft_wrap=True,
        highlight=False,
    )


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file; readers see the old or the new content, never a part."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.part")
    aside.write_text(json.dumps(value, indent=1) + "\n")
    os.replace(aside, path)


def _causes(causes: list[dict[str, Any]]) -> str:
    return "\n".join(
        line for cause in causes for line in (cause["effect"], *parameter_texts(cause))
    )


def _removed(report: dict[str, Any]) -> str:
    removed = (report.get("gain") or {}).get("reducible_removed") or {}
    if not isinstance(removed.get("value"), (int, float)) or report.get("verdict") == "none":
        return "–"
    text = f"{100 * removed['value']:.0f} %"
    if not all(isinstance(removed.get(end), (int, float)) for end in ("low", "high")):
        return text
    return f"{text}\n({100 * removed['low']:.0f} to {100 * removed['high']:.0f})"
