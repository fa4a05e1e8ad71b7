"""`palpate train`: the correction network of a dataset, on the raw model or on a run's extended
one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.app.commands.console import DatasetFolder, out, progress
from palpate.app.commands.diagnosis import true_effects

__all__ = ["train"]


def train(
    dataset: DatasetFolder,
    run: Annotated[
        str | None,
        typer.Option(
            help="Train on the extended model of this run below RUNS, not on the raw one."
        ),
    ] = None,
    truth: Annotated[
        bool, typer.Option("--truth", help="Train on a virtual dataset's true effects instead.")
    ] = False,
    kind: Annotated[
        str, typer.Option(help="unet2d (over the top), unet3d (volume) or graph (any mesh).")
    ] = "unet2d",
    features: Annotated[
        str, typer.Option(help="Features of the blocks, from fine to coarse.")
    ] = "64,128,256",
    trust: Annotated[
        float, typer.Option(help="Largest correction along each axis, in voxels.")
    ] = 0.5,
    inputs: Annotated[
        str, typer.Option(help="Inputs of the network on the tool: pose, velocity, force.")
    ] = "pose",
    distance: Annotated[str, typer.Option(help="chamfer, symmetric or hausdorff.")] = "chamfer",
    hold: Annotated[
        float, typer.Option(help="Weight that keeps hidden vertices near the simulation, 1/mm.")
    ] = 1.0,
    epochs: Annotated[int, typer.Option(help="Most epochs.")] = 40,
    patience: Annotated[
        int,
        typer.Option(help="Epochs without a smaller validation error before the training ends."),
    ] = 6,
    batch: Annotated[int, typer.Option(help="Samples in a step.")] = 64,
    rate: Annotated[float, typer.Option(help="Learning rate.")] = 5e-4,
    every: Annotated[int, typer.Option(help="Use one of this many clouds.")] = 1,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
    seed: Annotated[
        int,
        typer.Option(
            min=0, help="Seed of initial weights and order; the same seed gives the same weights."
        ),
    ] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes that replay.")] = 2,
    runs: Annotated[Path, typer.Option(help="The training goes to RUNS/trainings.")] = Path("runs"),
) -> None:
    """Train the network that corrects the replay of a model, on the train sequences, until the
    validation error stops falling.

    Can be stopped at any time: the same command resumes.
    """
    from palpate.app.jobs.tasks import train as learn
    from palpate.app.storage.result_store import request_name

    network = {
        "kind": kind,
        "features": _numbers(features),
        "trust": trust,
        "inputs": inputs.split(","),
    }
    spec = {
        "network": network,
        "distance": distance,
        "hold": hold,
        "rate": rate,
        "batch": batch,
        "epochs": epochs,
        "patience": patience,
        "device": device,
        "seed": seed,
    }
    plan = {"spec": spec, "every": every}
    hidden = true_effects(dataset) if truth else None
    name = dataset.resolve().name
    folder = request_name(f"{name}-{kind}", [str(dataset.resolve()), run, hidden, plan])
    request = {
        "dataset": str(dataset),
        "runs": str(runs),
        "workers": workers,
        "run": run,
        "truth": hidden,
        "training": plan,
        "folder": folder,
    }
    with progress(f"train {dataset.name}") as report:
        result = learn(request, report)
    gain = 100 * (1 - result["error"] / result["without"])
    out.print(
        f"mean distance in validation: {result['error']:.3f} mm, "
        f"{result['without']:.3f} mm without the network ({gain:.0f} % less)",
        highlight=False,
    )
    out.print(f"{runs / 'trainings' / result['training']}", highlight=False, soft_wrap=True)


def _numbers(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"--features reads like 64,128,256, got {text!r}") from None
