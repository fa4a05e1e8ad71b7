"""`palpate sweep`: the error as a function of parameters of the setup and of effects."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from palpate.app.commands.console import DatasetFolder, RegistrationOption, out, progress
from palpate.foundation.errors import EffectError
from palpate.foundation.quantities import quantity

__all__ = ["sweep"]


def sweep(
    dataset: DatasetFolder,
    parameter: Annotated[
        list[str],
        typer.Option(
            "--parameter",
            "-p",
            help="EFFECT.PARAMETER=LOW:HIGH, SI; may be repeated.",
            show_default=False,
        ),
    ],
    fix: Annotated[
        list[str] | None, typer.Option(help="EFFECT.PARAMETER=VALUE that all points have.")
    ] = None,
    method: Annotated[str, typer.Option(help="grid, random, tpe or cmaes.")] = "grid",
    steps: Annotated[int, typer.Option(help="Steps of a grid along each parameter.")] = 7,
    levels: Annotated[int, typer.Option(help="Levels of a grid from coarse to fine.")] = 1,
    points: Annotated[int, typer.Option(help="Number of points of the other methods.")] = 40,
    sequence: Annotated[
        list[str] | None, typer.Option(help="Sequences to replay; all if omitted.")
    ] = None,
    frames: Annotated[
        int, typer.Option(help="Clouds of each sequence: deep pushes that differ.")
    ] = 8,
    measure: Annotated[
        str, typer.Option(help="distance (RMS of patch averages) or paper (mean distance).")
    ] = "distance",
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random draws.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask scheduler whose workers replay instead.")
    ] = None,
    registration: RegistrationOption = None,
    runs: Annotated[
        Path, typer.Option(help="Points go to RUNS/sweeps; known ones are not computed again.")
    ] = Path("runs"),
) -> None:
    """Replay a dataset over a range of parameters; print where the error is smallest and which
    parameters do not affect it.

    Can be stopped at any time: the same command resumes.
    """
    from palpate.app.storage.registration_store import accepted_for
    from palpate.app.storage.result_store import request_name
    from palpate.app.storage.sweep_store import SweepStore
    from palpate.dataset import open_dataset
    from palpate.sweep.run_sweep import run_sweep
    from palpate.sweep.sweep_spec import SweepSpec

    plan = {
        "parameters": [_axis(text) for text in parameter],
        "fixed": dict(_fixed(text) for text in fix or ()),
        "method": method,
        "steps": steps,
        "levels": levels,
        "points": points,
        "sequences": sequence or (),
        "frames": frames,
        "measure": measure,
        "seed": seed,
    }
    request = SweepSpec.from_json(plan)
    accepted = accepted_for(dataset, registration, runs)
    opened, sweeps = open_dataset(dataset).registered(accepted), SweepStore(runs)
    parts = [str(dataset.resolve()), request.to_json(), *([accepted.to_json()] if accepted else [])]
    folder = sweeps.folder / request_name(dataset.resolve().name, parts)
    with progress(f"sweep {dataset.name}") as report:
        result = run_sweep(
            opened,
            request,
            folder,
            store=sweeps.replay_cache,
            workers=workers,
            scheduler=scheduler,
            report=report,
        )
    _print(
        result,
        sweeps.points(folder.name),
        {axis.name: axis.parameter.unit for axis in request.space.axes},
    )
    out.print(f"{folder}", highlight=False, soft_wrap=True)


def _axis(text: str) -> dict[str, Any]:
    name, _, span = text.partition("=")
    low, _, high = span.partition(":")
    try:
        return {"parameter": name, "low": float(low), "high": float(high)}
    except ValueError:
        raise EffectError(
            f"{text!r} is no range; expected EFFECT.PARAMETER=LOW:HIGH, "
            "as in poisson_ratio.nu=0.3:0.49"
        ) from None


def _fixed(text: str) -> tuple[str, float | str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise EffectError(f"{text!r} fixes nothing; expected EFFECT.PARAMETER=VALUE")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _print(result: dict[str, Any], rows: list[dict[str, Any]], units: dict[str, str]) -> None:
    table = Table(title="best points", header_style="bold")
    for name in units:
        table.add_column(name, justify="right")
    for name in ("error", "paper's distance"):
        table.add_column(name, justify="right")
    known = sorted(
        (row for row in rows if row["error"] is not None and row["values"]),
        key=lambda row: float(row["error"]),
    )
    for row in known[:8]:
        values = (quantity(row["values"][name], unit) for name, unit in units.items())
        table.add_row(*values, *(f"{1e3 * row[key]:.4f} mm" for key in ("error", "paper")))
    out.print(table)
    out.print(f"[bold]{escape(result['sentence'])}[/]", highlight=False, soft_wrap=True)
    out.print(
        f"{result['points']} points, {result['failed']} failed; the untouched phantom is off by "
        f"{1e3 * result['at_rest']:.4f} mm",
        highlight=False,
    )
    for one in result["directions"]:
        change = f"{1e3 * one['change']:.4f} mm ({1e3 * one['low']:.4f} to {1e3 * one['high']:.4f})"
        out.print(f"{one['name']}: {_verdict(one)}; the error changes by {change}", highlight=False)
    for row in [row for row in rows if row["failure"]][:5]:
        out.print(f"[yellow]point {row['number']} failed[/]: {row['failure']}", highlight=False)


def _verdict(direction: dict[str, Any]) -> str:
    if direction["flat"] is None:
        return "one push only, so nobody knows whether it matters"
    if direction["flat"]:
        return "flat: the clouds say nothing of it"
    return "matters little" if direction["little"] else "matters"
