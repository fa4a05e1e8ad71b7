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
    """Print versions, machine, settings, the last jobs and the log, without data or results."""
    from palpate.app.server.diagnostics import diagnostics

    settings = Settings(runs=runs)
    typer.echo(diagnostics(runs, settings.model_dump(mode="json")), nl=False)
