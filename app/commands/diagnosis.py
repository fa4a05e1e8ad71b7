"""`palpate diagnose`: find the causes of the simulation's error, for one dataset or several."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from palpate.app.commands.console import (
    DatasetFolders,
    RegistrationOption,
    out,
    print_warnings,
    progress,
    verdict_cells,
    verdict_table,
    write_json,
)
from palpate.app.reporting.report_tables import limit_rows, ranking_note, ranking_rows
from palpate.app.reporting.sentences import (
    control_sentences,
    determined_sentences,
    left_sentences,
    palpation_sentences,
    probe_sentence,
    registration_sentences,
    verdict_sentence,
)
from palpate.app.reporting.stiffness_sentences import stiffness_sentences
from palpate.foundation.errors import DatasetError, RunError
from palpate.foundation.quantities import with_interval

if TYPE_CHECKING:
    from palpate.dataset.accepted_registration import AcceptedRegistration

__all__ = ["diagnose", "print_report", "run_diagnosis", "true_effects", "truth_beside"]


def diagnose(
    datasets: DatasetFolders,
    file: Annotated[
        Path | None, typer.Option("--out", help="The report (JSON); for several datasets a folder.")
    ] = None,
    run: Annotated[
        Path | None,
        typer.Option(help="Store the run folder here; for several datasets a folder of them."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random draws.")] = 0,
    registration: RegistrationOption = None,
    runs: Annotated[Path, typer.Option(help="Folder of the accepted registrations.")] = Path(
        "runs"
    ),
    tolerance: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Size in mm (RMS) from which on structured error matters; the larger of 0.1 mm "
            "and 3 % of the surface's motion if omitted.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Find the causes of the simulation's error in each dataset, and what they gain on sequences
    that nothing was fitted on.
    """
    from palpate.app.storage.disk_usage import keep_meshes
    from palpate.app.storage.registration_store import accepted_for

    keep_meshes(runs)
    several = len(datasets) > 1
    _refuse_place(file, run, several)
    _refuse_broken(datasets)
    registered = {path: accepted_for(path, registration, runs) for path in datasets}
    truths = {path: truth_beside(path) for path in datasets}
    with_truth = any(truths.values())
    table = verdict_table(with_truth)
    for path in datasets:
        with _run_folder(run / path.name if run and several else run, path.name) as place:
            report, seconds = run_diagnosis(
                path,
                place,
                workers,
                seed,
                registered[path],
                None if tolerance is None else 1e-3 * tolerance,
            )
        table.add_row(*verdict_cells(path.name, report, seconds, truths[path], with_truth))
        if file is not None:
            write_json(file / f"{path.name}.json" if several else file, report)
        if several:
            out.print(f"{path.name}: {verdict_sentence(report)}", highlight=False)
            print_warnings(report.get("warnings", []))
        else:
            print_report(report)
    out.print(table)


def run_diagnosis(
    dataset: Path,
    run: Path,
    workers: int,
    seed: int,
    accepted: AcceptedRegistration | None = None,
    tolerance: float | None = None,
) -> tuple[dict[str, Any], float]:
    """Diagnose with a progress bar; returns report and time [s]. The run folder appears whole or
    not at all.
    """
    from palpate.app.jobs.tasks import diagnose_into

    began = time.monotonic()
    run.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=".making-", dir=run.parent))
    try:
        with progress(f"diagnose {dataset.name}") as report:
            result = diagnose_into(
                dataset,
                run,
                scratch,
                workers=workers,
                seed=seed,
                report=report,
                accepted=accepted,
                tolerance=tolerance,
            )
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return result, time.monotonic() - began


def truth_beside(dataset: Path) -> dict[str, Any] | None:
    """Content of `<dataset>.truth.json`; None where there is none. It is only compared with
    results.
    """
    path = dataset.resolve().with_name(f"{dataset.resolve().name}.truth.json")
    try:
        truth = json.loads(path.read_text())
        return truth if "verdict" in truth and "effects" in truth else None
    except (OSError, ValueError, TypeError):
        return None


def true_effects(dataset: Path) -> list[dict[str, Any]]:
    """Hidden effects of a virtual dataset, as `Effect.to_json`; raises RunError where they are
    unknown.
    """
    truth, file = truth_beside(dataset), f"{dataset.resolve().name}.truth.json"
    if truth is None:
        raise RunError(f"{dataset} has no {file} beside it; leave --truth out", file=file)
    return [
        {
            "effect": one["effect"],
            "parameters": {key: entry["value"] for key, entry in one["parameters"].items()},
        }
        for one in truth["effects"]
    ]


def print_report(report: dict[str, Any]) -> None:
    """Print the verdict in one sentence, then the results that support it."""
    lines: list[Any] = [Text(verdict_sentence(report), style="bold")]
    gain = report.get("gain") or {}
    steps = {
        key.replace("_", " "): gain.get(key) for key in ("baseline", "extended", "noise_floor")
    }
    shown = ", ".join(
        f"{value:.3g} {gain.get('unit', 'mm')} {name}"
        for name, value in steps.items()
        if isinstance(value, (int, float))
    )
    if shown:
        lines.append(Text(f"error on the {gain.get('split', 'test')} sequences: {shown}"))
    for one in report.get("identified", []):
        shown = ", ".join(
            f"{name} {with_interval(entry)}" for name, entry in one["parameters"].items()
        )
        lines.append(
            Text(f"identified: {one['effect']}: {shown}; {one.get('why', '')}", style="dim")
        )
    for one in report.get("not_identifiable", []):
        lines.append(Text(f"not identifiable: {one['effect']}: {one.get('why', '')}", style="dim"))
    lines += [Text(" ".join(sentence)) for sentence in [left_sentences(report)] if sentence]
    lines += [Text(sentence, style="dim") for sentence in registration_sentences(report)]
    lines += [Text(sentence) for sentence in palpation_sentences(report)]
    lines += [Text(sentence) for sentence in stiffness_sentences(report)]
    lines += [
        Text(sentence, style="dim") for sentence in determined_sentences(report.get("causes", []))
    ]
    lines += [
        Text(f"control: {sentence}", style="dim")
        for sentence in control_sentences(report.get("controls") or [])
    ]
    lines += [
        Text(f"next probe: {probe_sentence(row)}") for row in (report.get("next_probe") or [])[:1]
    ]
    out.print(Panel(Group(*lines), expand=False))
    print_warnings(report.get("warnings", []))
    if report.get("ranking"):
        out.print(_ranking(report))
    if report.get("ambiguity_map"):
        out.print(_limits(report))


def _ranking(report: dict[str, Any]) -> Table:
    table = Table(header_style="bold", caption=ranking_note(report), caption_justify="left")
    table.add_column("effect")
    table.add_column("error removed", justify="right")
    table.add_column("probability", justify="right")
    for row in ranking_rows(report):
        table.add_row(row.effect, row.removed, row.probability, style="bold" if row.named else None)
    return table


def _limits(report: dict[str, Any]) -> Table:
    table = Table(header_style="bold", title="What this data can tell", title_justify="left")
    table.add_column("effect")
    table.add_column("would be named from")
    table.add_column("looks most like")
    for row in limit_rows(report):
        table.add_row(row.effect, row.size, row.like)
    return table


def _refuse_place(file: Path | None, run: Path | None, several: bool) -> None:
    """Raise BadParameter, before the diagnosis, where the report could not be written."""
    if file is None:
        return
    if several and file.is_file():
        raise typer.BadParameter(
            f"--out {file} is a file; of several datasets it is a folder of their reports"
        )
    if not several and file.is_dir():
        raise typer.BadParameter(
            f"--out {file} is a folder; name a file, such as {file / 'report.json'}"
        )
    if not several and run is not None and file.resolve() == run.resolve():
        raise typer.BadParameter(
            f"--out and --run are both {file}: the one is a file, the other a folder "
            "that has the report, too"
        )


def _refuse_broken(datasets: list[Path]) -> None:
    from palpate.dataset import open_dataset

    names = [path.name for path in datasets]
    if len(set(names)) < len(names):
        raise DatasetError(
            f"two of the datasets have the same folder name: {', '.join(sorted(names))}; "
            "diagnose them one by one"
        )
    for path in datasets:
        try:
            open_dataset(path).validate()
        except DatasetError as error:
            raise DatasetError(
                f"{path}: {error.message}", **{"dataset": path.name, **error.where}
            ) from error


@contextmanager
def _run_folder(run: Path | None, name: str) -> Iterator[Path]:
    """The requested run folder, or one in a temporary place that is deleted afterwards."""
    if run is not None:
        if run.exists():
            raise RunError(
                f"{run} exists already; name another folder or move it away", file=str(run)
            )
        yield run
        return
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        yield Path(folder) / name
