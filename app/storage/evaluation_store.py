"""Evaluations on disk, below the runs folder, and the job that makes one."""

from __future__ import annotations

from pathlib import Path

from palpate.app.http_errors import Missing
from palpate.app.storage.result_folder import Kept
from palpate.app.storage.training_store import Trainings

__all__ = ["Evaluations", "networks_for"]


class Evaluations(Kept):
    """The folder of evaluations."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs, "evaluation", "evaluations", "evaluation.json", "evaluation.json")


def networks_for(
    trainings: Trainings, dataset: Path, run: str | None, named: list[str], truth: bool = False
) -> dict[str, Path]:
    """Folders of trained networks by the model they correct: those that are named, or the newest
    ones.

    Missing where a named training is not there, is not finished, or is of something else.
    """
    if not named:
        wanted = [
            ("baseline", None),
            *([("extended", run)] if run else []),
            *([("true", None)] if truth else []),
        ]
        found = {model: trainings.newest(dataset, model, of) for model, of in wanted}
        return {model: folder for model, folder in found.items() if folder is not None}
    networks = {}
    for name in named:
        asked = trainings.asked(name)
        if trainings.found(name) is None:
            raise Missing(
                f"training {name} is not finished; wait for it, or have it go on", training=name
            )
        if asked.get("dataset") != str(dataset.resolve()) or asked.get("run") not in (None, run):
            raise Missing(
                f"training {name} is of another dataset or run; name one of this", training=name
            )
        model = str(asked["model"])
        networks[f"{model}:{name}" if model in networks else model] = trainings.folder / name
    return networks
