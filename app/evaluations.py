"""Evaluations on disk, below the runs folder, and the job that makes one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.kept import Kept
from app.problems import Missing
from app.runs import Runs
from app.trainings import Trainings
from core.progress import Report

__all__ = ["Evaluations", "evaluate", "networks_for"]


class Evaluations(Kept):
    """The folder of evaluations."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs, "evaluation", "evaluations", "evaluation.json", "evaluation.json")


def networks_for(trainings: Trainings, dataset: Path, run: str | None, named: list[str], truth: bool = False) -> dict[str, Path]:
    """Folders of trained networks by the model they correct: those that are named, or the newest ones.

    Missing where a named training is not there, is not finished, or is of something else.
    """
    if not named:
        wanted = [("baseline", None), *([("extended", run)] if run else []), *([("true", None)] if truth else [])]
        found = {model: trainings.newest(dataset, model, of) for model, of in wanted}
        return {model: folder for model, folder in found.items() if folder is not None}
    networks = {}
    for name in named:
        asked = trainings.asked(name)
        if trainings.found(name) is None:
            raise Missing(f"training {name} is not finished; wait for it, or have it go on", training=name)
        if asked.get("dataset") != str(dataset.resolve()) or asked.get("run") not in (None, run):
            raise Missing(f"training {name} is of another dataset or run; name one of this", training=name)
        model = str(asked["model"])
        networks[f"{model}:{name}" if model in networks else model] = trainings.folder / name
    return networks


def evaluate(request: Mapping[str, Any], report: Report) -> dict[str, Any]:
    """The job: the ladder of `request["dataset"]`; the folder has the name of the job."""
    from core.dataset import open_dataset  # noqa: PLC0415 (heavy)
    from core.evaluation.running import Asked  # noqa: PLC0415 (heavy)
    from core.evaluation.running import evaluate as climb  # noqa: PLC0415 (heavy)

    runs = Path(request["runs"])
    name, dataset = str(request.get("folder") or Path(request["scratch"]).name), Path(request["dataset"])
    run = Runs(runs).get(request["run"]) if request.get("run") else None
    networks = networks_for(
        Trainings(runs), dataset, request.get("run"), list(request.get("trainings", ())), request.get("truth") is not None
    )
    asked = Asked(
        model=None if run is None else run.model,
        truth=request.get("truth"),
        networks=networks,
        feedback=request.get("feedback", "none"),
    )
    out = Evaluations(runs).folder / name
    found = climb(open_dataset(dataset), asked, out, workers=int(request["workers"]), seed=int(request["seed"]), report=report)
    return {"evaluation": name, "sentence": found["sentence"]}
