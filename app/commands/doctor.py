"""`palpate doctor`: what a maintainer asks for when something fails."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.app.settings import Settings

__all__ = ["doctor"]


def doctor(
    runs: Annotated[Path, typer.Option(help="Folder of finished diagnoses.")] = Path("runs"),
) -> None:
    """Print versions, machine, the settings of the last server, its last jobs and its log, without
    data or results.
    """
    from palpate.app.server.diagnostics import diagnostics, noted_settings

    settings = noted_settings(runs)
    if settings is None:
        settings = {"no server was started with these runs": "the defaults follow"}
        settings |= Settings(runs=runs).model_dump(mode="json")
    typer.echo(diagnostics(runs, settings), nl=False)
