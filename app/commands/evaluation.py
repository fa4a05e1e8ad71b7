"""`palpate evaluate`: errors of models and networks on test sequences, and the tables
of the paper.
"""

from __future__ import annotations

import secrets
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from palpate.app.commands.console import as_tables, out, progress, write_json
from palpate.app.commands.diagnosis import true_effects
from palpate.foundation.quantities import quantity

__all__ = ["evaluate"]

SHOWN = {"all": "all pushes", "seen": "kinds trained on", "unseen": "kinds never trained on"}


def evaluate(
    dataset: Annotated[
        Path,
        typer.Argument(
            help="A dataset folder; --paper makes it if it does not exist.",
            show_default=False,
            callback=as_tables,
        ),
    ],
    run: Annotated[
        str | None,
        typer.Option(help="A diagnosis below RUNS whose extended model is evaluated too."),
    ] = None,
    training: Annotated[
        list[str] | None,
        typer.Option(help="Trainings below RUNS/trainings; the newest ones if omitted."),
    ] = None,
    feedback: Annotated[
        str,
        typer.Option(
            help="none, or follow: the simulation moves the points that a network does not see."
        ),
    ] = "none",
    truth: Annotated[
        bool,
        typer.Option(
            "--truth", help="Also the true effects of a virtual dataset, from DATASET.truth.json."
        ),
    ] = False,
    paper: Annotated[
        bool,
        typer.Option(
            "--paper", help="The three tables of Wu, Kazanzides and Unberath (2020) instead."
        ),
    ] = False,
    size: Annotated[
        str,
        typer.Option(
            help="Size of the dataset that --paper makes: short, medium or full (14 minutes)."
        ),
    ] = "full",
    epochs: Annotated[
        int, typer.Option(help="Most epochs of each network that --paper trains.")
    ] = 40,
    features: Annotated[
        str, typer.Option(help="Features of these networks' blocks.")
    ] = "64,128,256",
    every: Annotated[int, typer.Option(help="These networks use one of this many clouds.")] = 1,
    file: Annotated[
        Path | None, typer.Option("--out", dir_okay=False, help="The result (JSON).")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random draws.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
    runs: Annotated[Path, typer.Option(help="Results go to RUNS/evaluations.")] = Path("runs"),
) -> None:
    """Compare the raw model, the extended model and their networks on the test sequences.

    With --paper: the paper's searches for the modulus, and its corrections at 5e3, 1e4 and 1e1 Pa,
    in 2D and 3D.
    """
    if feedback not in ("none", "follow"):
        raise typer.BadParameter(f"--feedback is none or follow, not {feedback!r}")
    if paper:
        _make(dataset, size, workers)
        result = _paper(
            dataset, [int(one) for one in features.split(",")], epochs, every, seed, workers, runs
        )
    else:
        result = _ladder(
            dataset,
            {"run": run, "trainings": training or [], "feedback": feedback, "seed": seed},
            truth,
            workers,
            runs,
        )
    if file is not None:
        write_json(file, result)


def _ladder(
    dataset: Path, choices: dict[str, Any], truth: bool, workers: int, runs: Path
) -> dict[str, Any]:
    from palpate.app.jobs.tasks import evaluate as climb
    from palpate.app.storage.evaluation_store import EvaluationStore

    name = f"{dataset.resolve().name}-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(4)}"
    hidden = true_effects(dataset) if truth else None
    request = {
        **choices,
        "dataset": str(dataset),
        "runs": str(runs),
        "workers": workers,
        "truth": hidden,
        "folder": name,
    }
    with progress(f"evaluate {dataset.name}") as report:
        climb(request, report)
    evaluations = EvaluationStore(runs)
    result = evaluations.result(name) or {}
    out.print(f"[bold]{result['sentence']}[/]", highlight=False)
    for one in result["parts"]:
        if one["part"] != "kind":
            out.print(_rungs(result["rungs"], one))
    out.print(f"{evaluations.folder / name}", highlight=False, soft_wrap=True)
    return result


def _rungs(rungs: list[dict[str, Any]], one: dict[str, Any]) -> Table:
    title = (
        f"{SHOWN.get(one['part'], one['name'])}: {', '.join(one['kinds'])}; {one['probes']} pushes"
    )
    table = Table(title=title, title_justify="left", header_style="bold")
    table.add_column("model")
    for name in ("error", "removed", "of the moving part", "mean distance", "nearer"):
        table.add_column(name, justify="right")
    for rung in rungs:
        own = one["errors"][rung["name"]]
        shares = (own["removed"], own["moving"]["removed"], own["paper"]["improvement"])
        removed, moving, nearer = (
            "–" if rung["name"] == "baseline" else _share(share) for share in shares
        )
        table.add_row(
            rung["label"],
            f"{own['error']:.3f} mm",
            removed,
            moving,
            f"{own['paper']['error']:.3f} mm",
            nearer,
        )
    table.add_row("noise floor", f"{one['noise_floor']:.3f} mm", "", "", "", "")
    return table


def _share(share: dict[str, float]) -> str:
    return f"{100 * share['value']:.0f} % ({100 * share['low']:.0f} to {100 * share['high']:.0f})"


def _make(dataset: Path, size: str, workers: int) -> None:
    """Make the virtual dataset of the paper's protocol, unless it exists."""
    from palpate.synthetic import PAPER_SEED, PAPER_SIZES, make_dataset, paper_scenario

    known_size = next((one for one in PAPER_SIZES if one == size), None)
    if known_size is None:
        raise typer.BadParameter(f"--size is one of {', '.join(PAPER_SIZES)}, not {size!r}")
    if not dataset.is_dir():
        with progress(f"make {dataset.name}") as report:
            make_dataset(dataset, paper_scenario(known_size), PAPER_SEED, workers, report)


def _paper(
    dataset: Path, features: list[int], epochs: int, every: int, seed: int, workers: int, runs: Path
) -> dict[str, Any]:
    from palpate.app.storage.sweep_store import SweepStore
    from palpate.app.storage.training_store import TrainingStore
    from palpate.dataset import open_dataset
    from palpate.evaluation.paper_tables import PaperRequest, run_paper
    from palpate.evaluation.train_network import TrainingPlan

    training = TrainingPlan(
        spec={"network": {"features": features}, "epochs": epochs, "seed": seed}, every=every
    )
    folder = runs / "paper" / dataset.resolve().name
    with progress(f"the paper's tables on {dataset.name}") as report:
        result = run_paper(
            open_dataset(dataset),
            folder,
            store=SweepStore(runs).replay_cache,
            samples=TrainingStore(runs).sample_cache,
            request=PaperRequest(training=training),
            workers=workers,
            seed=seed,
            report=report,
        )
    for title, key in (("Table 1: coarse search", "coarse"), ("Table 2: fine search", "fine")):
        out.print(_moduli(title, result[key]))
    out.print(result["what_the_search_shows"], highlight=False)
    out.print(_corrections(result["correction"]))
    out.print(f"{folder / 'paper.json'}", highlight=False, soft_wrap=True)
    return result


def _moduli(title: str, rows: list[dict[str, Any]]) -> Table:
    table = Table(title=title, title_justify="left", header_style="bold")
    table.add_column("Young's modulus", justify="right")
    table.add_column("mean distance", justify="right")
    for row in rows:
        shown = "–" if row["mean_distance"] is None else f"{row['mean_distance']:.4f} mm"
        table.add_row(quantity(row["young_modulus"], "Pa", 3), shown)
    return table


def _corrections(rows: list[dict[str, Any]]) -> Table:
    table = Table(
        title="Table 3: correction on test sequences, mean distance in mm",
        title_justify="left",
        header_style="bold",
    )
    table.add_column("Young's modulus", justify="right")
    table.add_column("motion")
    for name in ("simulation", "2D network", "nearer by", "3D network", "nearer by", "3D over 2D"):
        table.add_column(name, justify="right")
    for row in rows:
        for one in row["parts"]:
            cells = [f"{one['simulation']['error']:.3f}"]
            for kind in ("unet2d", "unet3d"):
                cells += [f"{one[kind]['error']:.3f}", _share(one[kind]["improvement"])]
            table.add_row(
                quantity(row["young_modulus"], "Pa", 3),
                one["name"],
                *cells,
                _share(one["unet3d_beyond_unet2d"]),
            )
    return table
