"""`palpate demo`: hide an effect, find it, and open the page on it."""

from __future__ import annotations

import secrets
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from palpate.app.commands.console import (
    out,
    print_serve_command,
    progress,
    verdict_cells,
    verdict_table,
)
from palpate.app.commands.diagnosis import print_report, run_diagnosis
from palpate.app.commands.service import announce
from palpate.app.settings import Settings

__all__ = ["demo"]


def demo(
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the hidden effects; random if omitted.")
    ] = None,
    effects: Annotated[int, typer.Option(min=0, max=2, help="Number of effects to hide.")] = 1,
    palpation: Annotated[
        str | None,
        typer.Option(
            help="Palpate by force alone, without a camera: a box or an organ, with a lump "
            "or with --effects 0."
        ),
    ] = None,
    shape: Annotated[
        str | None,
        typer.Option(
            help="A phantom of another shape than a block: dome, liver, kidney, breast, cylinder "
            "or grooved."
        ),
    ] = None,
    show: Annotated[
        bool, typer.Option("--serve/--no-serve", help="Open the page afterwards.")
    ] = True,
    folder: Annotated[Path, typer.Option(help="Folder of dataset and run.")] = Path("runs/demo"),
    port: Annotated[int, typer.Option(min=0, max=65535)] = 8321,
    workers: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
) -> None:
    """Make a virtual phantom with a hidden effect, diagnose it, and compare the verdict with the
    truth.
    """
    if palpation not in (None, "box", "organ"):
        raise typer.BadParameter(f"--palpation is box or organ, not {palpation!r}")
    if palpation and effects > 1:
        raise typer.BadParameter("--palpation hides one lump at most: --effects 0 or 1")
    if shape and palpation:
        raise typer.BadParameter("--shape has a camera and --palpation has none: give one")
    chosen = secrets.randbelow(1_000_000) if seed is None else seed
    again = (
        f"palpate demo --seed {chosen}"
        + (f" --palpation {palpation}" if palpation else "")
        + (f" --shape {shape}" if shape else "")
    )
    out.print(f"seed [bold]{chosen}[/]  (the same again: {again})", highlight=False)
    dataset = folder / "datasets" / f"{palpation or shape or 'demo'}-{chosen}-{effects}"
    truth = _make(dataset, chosen, effects, workers, palpation, shape)
    run = folder / "runs" / f"{dataset.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    report, seconds = run_diagnosis(dataset, run, workers, chosen)
    print_report(report)
    table = verdict_table(with_truth=True, title="the verdict beside the truth")
    table.add_row(*verdict_cells(dataset.name, report, seconds, truth, True))
    out.print(table)
    if show:
        from palpate.app.main import create_app
        from palpate.app.server.serve import serve

        settings = Settings(
            port=port, runs=folder / "runs", datasets=folder / "datasets", workers=workers
        )
        serve(
            create_app(settings),
            settings.host,
            settings.port,
            lambda address: announce(address, f"/?run={run.name}"),
        )
    else:
        print_serve_command(folder)


def _make(
    dataset: Path, seed: int, effects: int, workers: int, palpation: str | None, shape: str | None
) -> dict[str, Any]:
    """Make the dataset of this seed and return its truth; an existing one is used again."""
    from palpate.app.commands.diagnosis import truth_beside
    from palpate.synthetic import (
        SHORT_PROTOCOL,
        draw_palpation,
        draw_scenario,
        draw_shape_scenario,
        make_dataset,
        make_palpation,
        make_shape_dataset,
    )

    known = truth_beside(dataset) if dataset.is_dir() else None
    if known is not None:
        return known
    with progress("make the phantom") as report:
        if palpation:
            body: Literal["box", "organ"] = "box" if palpation == "box" else "organ"
            return make_palpation(
                dataset, draw_palpation(body, effects, seed), seed, workers, report
            ).as_dict()
        if shape:
            drawn = draw_shape_scenario(shape, effects, seed)
            return make_shape_dataset(dataset, drawn, seed, workers, report).as_dict()
        scenario = replace(draw_scenario(seed, effects), sequences=SHORT_PROTOCOL)
        return make_dataset(dataset, scenario, seed, workers, report).as_dict()
