"""`palpate blind`: how often the verdict is right when nobody knows what is hidden."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from app.console import out, parameters_text, progress
from core.blind import Case, Result, all_cases, run_suite

__all__ = ["blind"]


def blind(
    folder: Annotated[Path, typer.Option(help="Where the results go; what stands there is not done again.")] = Path("runs/blind"),
    seed: Annotated[int, typer.Option(min=0, help="All hidden parameters follow from it.")] = 0,
    controls: Annotated[int, typer.Option(min=0, help="Datasets in which nothing is hidden.")] = 10,
    workers: Annotated[int, typer.Option(min=1, help="Datasets at the same time.")] = 2,
    only: Annotated[str | None, typer.Option(help="Only cases whose name contains this.")] = None,
) -> None:
    """Hide each effect once at a clear size, what no effect expresses, and nothing ten times; print what was said.

    Can be stopped and taken up again.
    """
    cases = [case for case in all_cases(seed, controls) if only is None or only in case.name]
    with progress("blind suite") as report:
        results = run_suite(folder, cases, workers, report)
    out.print(_table(cases, results))
    for kind in ("effects", "outside the catalogue", "controls"):
        those = [result for result in results if _kind(result) == kind]
        named = "" if kind == "effects" else f", a cause named in {sum(bool(result.named) for result in those)}"
        out.print(f"{sum(result.right for result in those)} of {len(those)} {kind} right{named}", highlight=False)


def _kind(result: Result) -> str:
    return "outside the catalogue" if result.outside else "effects" if result.hidden else "controls"


def _table(cases: list[Case], results: list[Result]) -> Table:
    table = Table(title="blind suite", header_style="bold")
    for column in ("case", "hidden", "verdict", "named", "gain (bound)", "reducible error removed", "time", ""):
        table.add_column(column, overflow="fold")
    for result in results:
        removed = "–" if result.removed is None else f"{100 * result.removed:.0f} %"
        table.add_row(
            result.name, _causes(result.hidden) or result.outside or "nothing", result.verdict, _causes(result.named) or "–",
            f"{result.gain:.0f} ({result.bound:.0f}) nats", removed, f"{result.seconds:.0f} s",
            "[green]✓[/]" if result.right else "[red]✗[/]",
        )  # fmt: skip
    if len(results) < len(cases):
        table.caption = f"{len(cases) - len(results)} cases without a result"
    return table


def _causes(causes: list[dict[str, Any]]) -> str:
    return "; ".join(f"{cause['effect']}: {parameters_text(cause)}" for cause in causes)
