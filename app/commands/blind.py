"""`palpate blind`: how often the diagnosis of hidden effects is right."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE
from rich.console import Group
from rich.table import Table

from palpate.app.commands.console import out, print_serve_command, progress, write_json
from palpate.app.reporting.blind_tables import (
    TITLES,
    figure_text,
    hidden_text,
    named_text,
    target_text,
)
from palpate.blind import (
    RESULTS_FILE,
    Case,
    CaseResult,
    all_cases,
    draw_cases,
    known_results,
    read_results,
    run_case,
    run_suite,
    summary_of,
    with_nuisances,
)
from palpate.foundation.errors import RunError

__all__ = ["blind"]

CONTROLS = 10


def blind(
    folder: Annotated[
        Path, typer.Option(help="Folder of the results; existing ones are not computed again.")
    ] = Path("runs/blind"),
    scenarios: Annotated[
        int | None,
        typer.Option(min=1, help="Number of cases to draw; without it each effect is hidden once."),
    ] = None,
    kinds: Annotated[
        str | None,
        typer.Option(
            help="Kinds for --scenarios: control, clear, subtle, pair, outside, twins, modulus, "
            "fault."
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option(help="Effects to hide, separated by commas; all diagnosed ones if omitted."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all hidden parameters.")] = 0,
    controls: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Cases without a hidden effect; 10, or a quarter of --scenarios, if omitted.",
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Cases at the same time.")] = 2,
    only: Annotated[str | None, typer.Option(help="Only cases whose name contains this.")] = None,
    short: Annotated[
        bool,
        typer.Option(
            "--short", help="Five sequences instead of seven: faster and less informative."
        ),
    ] = False,
    nuisances: Annotated[
        bool,
        typer.Option(
            "--nuisances",
            help="Give the bench the faults of real cameras, robots, tools and phantoms.",
        ),
    ] = False,
    camera: Annotated[
        str | None,
        typer.Option(
            help="Camera of the bench with nuisances: d405, d415, d435, azure-kinect, "
            "structured-light; drawn if omitted."
        ),
    ] = None,
    filters: Annotated[
        str | None,
        typer.Option(
            "--filter",
            help="Filters on its images, separated by commas: decimation, spatial, hole-filling, "
            "temporal, or '' for none; drawn if omitted.",
        ),
    ] = None,
    shapes: Annotated[
        bool,
        typer.Option(
            "--shapes",
            help="Phantoms of other shapes than a block, of all families, with the robot related "
            "in all ways; of 60 scenarios 15 hide nothing, 25 one effect, 10 two, and 10 a "
            "disturbance outside the catalogue.",
        ),
    ] = False,
    any_version: Annotated[
        bool, typer.Option("--any-version", help="Also use results of other versions of the code.")
    ] = False,
    score: Annotated[
        bool,
        typer.Option(
            "--score", help="Run nothing: score the existing results, also of a running suite."
        ),
    ] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Repeat the cases that ended in an error.")
    ] = False,
    keep: Annotated[
        bool,
        typer.Option(
            "--keep", help="Store dataset and run of each case in FOLDER/kept, for the page."
        ),
    ] = False,
    datasets: Annotated[
        Path | None,
        typer.Option(
            help="Folder in which the datasets of cases stay; one that the same bench has made "
            "there is used again. A short case needs about 18 MB."
        ),
    ] = None,
) -> None:
    """Hide effects, disturbances outside the catalogue, and nothing; score the diagnosis of each
    case.

    Writes results.jsonl, summary.json and report.html into the folder. Can be stopped and resumed.
    """
    hidden, kept = _split(effects), folder / "kept"
    if keep and datasets is not None:
        raise typer.BadParameter("--keep stores the datasets itself; leave --datasets out")
    cases = _cases_of(seed, scenarios, _split(kinds), hidden, controls, short=short, shapes=shapes)
    if nuisances or camera is not None or filters is not None:
        cases = with_nuisances(cases, camera, _split(filters))
    cases = [case for case in cases if only is None or only in case.name]
    if score:
        results = known_results(folder, cases, any_version)
        if not results:
            raise RunError(_nothing_of(folder, len(cases)), file=str(folder))
    else:
        with progress("blind suite") as report:
            run = partial(run_case, kept=kept if keep else None, store=datasets)
            results = run_suite(
                folder, cases, workers, report, any_version=any_version, again=again, run=run
            )
    summary = summary_of(results, seed, missing=len(cases) - len(results))
    _write(folder, summary, results)
    out.print(_cases(results))
    out.print(_targets(summary["targets"]))
    for kind, counted in summary["kinds"].items():
        right, false = counted["right"], counted["false_name"]
        named = (
            f", a cause falsely named in {false['hits']}"
            if kind in ("control", "outside", "modulus", "fault")
            else ""
        )
        out.print(f"{TITLES[kind]}: {right['hits']} of {right['n']} right{named}", highlight=False)
    out.print(f"{folder / 'report.html'}", highlight=False, soft_wrap=True)
    if kept.exists():
        print_serve_command(kept)


def _cases_of(
    seed: int,
    scenarios: int | None,
    kinds: list[str] | None,
    effects: list[str] | None,
    controls: int | None,
    *,
    short: bool,
    shapes: bool,
) -> list[Case]:
    """The cases that these options ask for."""
    if scenarios is None:
        if kinds is not None or shapes:
            option = "--shapes" if shapes else "--kinds"
            raise typer.BadParameter(f"{option} needs --scenarios, the number of cases to draw")
        return all_cases(seed, CONTROLS if controls is None else controls, effects, short)
    return draw_cases(seed, scenarios, kinds, effects, controls, short, shapes=shapes)


def _nothing_of(folder: Path, cases: int) -> str:
    """The message for a folder that has no results of the requested cases."""
    others = len(read_results(folder / RESULTS_FILE))
    if not others:
        return f"{folder} holds no {RESULTS_FILE} with results to score"
    return (
        f"{folder / RESULTS_FILE}: none of its {others} results is of these {cases} cases; "
        "give the options that it was made with"
    )


def _split(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",") if part.strip()]


def _write(folder: Path, summary: dict[str, Any], results: Sequence[CaseResult]) -> None:
    from palpate.app.reporting.blind_page import blind_page

    write_json(folder / "summary.json", summary)
    aside = folder / ".report.html.part"
    aside.write_text(blind_page(summary, results))
    os.replace(aside, folder / "report.html")


def _cases(results: Sequence[CaseResult]) -> Table:
    """One row for each case, and below it the hidden and the named effects over the whole width."""
    table = Table(
        title="blind suite", header_style="bold", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    table.add_column("")
    table.add_column("case", overflow="fold")
    table.add_column("verdict")
    for column in ("gain (bound)", "removed", "time"):
        table.add_column(column, justify="right")
    for result in results:
        removed = "–" if result.removed is None else f"{100 * result.removed:.0f} %"
        effect_rows = Table.grid(padding=(0, 1))
        effect_rows.add_row("[dim]hidden[/]", hidden_text(result))
        effect_rows.add_row("[dim]named[/]", named_text(result))
        table.add_row(
            "[green]✓[/]" if result.right else "[red]✗[/]",
            Group(result.name, effect_rows),
            result.verdict,
            f"{result.gain:.0f} ({result.bound:.0f}) nats",
            removed,
            f"{result.seconds:.0f} s",
            end_section=True,
        )
    return table


def _targets(targets: Sequence[dict[str, Any]]) -> Table:
    """The targets that these cases can test."""
    table = Table(title="targets", header_style="bold")
    for column in ("", "target", "reached", "95 % interval", ""):
        table.add_column(column, overflow="fold")
    for one in targets:
        if one["met"] is not None:
            mark = "[green]✓[/]" if one["met"] else "[red]✗[/]"
            table.add_row(
                one["text"], target_text(one), *figure_text(one["reached"], one["unit"]), mark
            )
    return table
