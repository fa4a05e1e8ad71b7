"""`palpate export`: a finished diagnosis as one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.app.commands.console import out
from palpate.foundation.errors import RunError

__all__ = ["export"]


def export(
    run: Annotated[
        Path,
        typer.Argument(
            help="Folder of a run, as made by `palpate diagnose --run`.", show_default=False
        ),
    ],
    file: Annotated[
        Path | None,
        typer.Option(
            "--out", dir_okay=False, help="The page; RUN.html in the current folder if omitted."
        ),
    ] = None,
) -> None:
    """Write the report of a run as one self-contained HTML page: to keep, print or send."""
    from palpate.app.reporting.report_page import report_page
    from palpate.app.storage.run_store import Run

    if not (run / "report.json").is_file():
        raise RunError(
            f"{run} is no run: it has no report.json; "
            f"make one by palpate diagnose DATASET --run {run}",
            file=str(run),
        )
    path = file or Path(f"{run.resolve().name}.html")
    if path.suffix != ".html":
        raise RunError(f"{path}: the page is written as .html; name such a file", file=str(path))
    text = report_page(Run(run.resolve()))
    try:
        path.write_text(text)
    except OSError as error:
        raise RunError(f"{path} cannot be written ({error.strerror})", file=str(path)) from error
    out.print(f"wrote {path}", highlight=False)
