"""`palpate serve`, the page and the REST service, and `palpate doctor`, for a maintainer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.app.commands.console import out
from palpate.app.server.tokens import FILE, Token
from palpate.app.settings import Settings

__all__ = ["announce", "doctor", "serve"]


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; all but loopback addresses need a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes a free one.")] = 8321,
    runs: Annotated[Path, typer.Option(help="Folder of finished diagnoses.")] = Path("runs"),
    datasets: Annotated[Path, typer.Option(help="Folder of the datasets.")] = Path("datasets"),
    workers: Annotated[int, typer.Option(min=1, help="Processes one diagnosis may use.")] = 2,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(help="Another name of this server for browsers; needs a token."),
    ] = None,
    import_from: Annotated[
        list[Path] | None,
        typer.Option(
            help="Folder below which datasets may be imported by path; any, where there is no "
            "login."
        ),
    ] = None,
    disk_limit: Annotated[
        float,
        typer.Option(
            min=0.1,
            help="GiB of RUNS beyond which the oldest caches are deleted, and new jobs refused "
            "where the results alone take more.",
        ),
    ] = 20.0,
    new_token: Annotated[
        bool, typer.Option("--new-token", help="Make a new token; the old one becomes invalid.")
    ] = False,
) -> None:
    """Serve the page and the REST service on one port."""
    from palpate.app.main import create_app
    from palpate.app.server.serve import serve as run
    from palpate.app.storage.disk_usage import keep_meshes

    settings = Settings(
        host=host,
        port=port,
        runs=runs,
        datasets=datasets,
        workers=workers,
        allow_host=tuple(allow_host or ()),
        import_from=tuple(import_from or ()),
        disk_limit=int(disk_limit * 2**30),
    )
    if new_token or (settings.needs_login and not (runs / FILE).exists()):
        out.print(
            f"The token, shown only now: [bold]{Token.make(runs)}[/]",
            highlight=False,
            soft_wrap=True,
        )
    runs.mkdir(parents=True, exist_ok=True)
    keep_meshes(runs)
    run(create_app(settings), settings.host, settings.port, announce)


def announce(address: str, path: str = "/") -> None:
    """Print the address of the page."""
    out.print(f"Palpate is at [bold]{address}{path}[/]  (Ctrl-C ends it)", highlight=False)
    out.file.flush()


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
