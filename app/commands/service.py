"""`palpate serve`: the page and the REST service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.console import out
from app.settings import Settings, require_loopback

__all__ = ["serve"]


def serve(
    host: Annotated[str, typer.Option(help="Loopback address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes a free one.")] = 8321,
    runs: Annotated[Path, typer.Option(help="Folder of finished diagnoses.")] = Path("runs"),
    datasets: Annotated[Path, typer.Option(help="Folder below which the datasets lie.")] = Path("datasets"),
    workers: Annotated[int, typer.Option(min=1, help="Processes one diagnosis may use.")] = 2,
) -> None:
    """Serve the page and the REST service on one port of this machine."""
    from app.serve import serve as run  # noqa: PLC0415 (heavy)

    require_loopback(host)
    run(Settings(host=host, port=port, runs=runs, datasets=datasets, workers=workers), announce)


def announce(address: str, path: str = "/") -> None:
    """Say where the page is."""
    out.print(f"Palpate is at [bold]{address}{path}[/]  (Ctrl-C ends it)", highlight=False)
    out.file.flush()
