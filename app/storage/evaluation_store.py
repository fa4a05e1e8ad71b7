"""Evaluations on disk, below the runs folder, and the networks that an evaluation uses."""

from __future__ import annotations

from pathlib import Path

from palpate.app.http_errors import Missing
from palpate.app.storage.result_store import ResultStore
from palpate.app.storage.training_store import TrainingStore

__all__ = ["EvaluationStore", "networks_for"]


class EvaluationStore(ResultStore):
    """The folder of evaluations; each consists of one file."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs / "evaluations", "evaluation", "evaluation.json", "evaluation.json")


def networks_for(
    trainings: TrainingStore, dataset: Path, run: str | None, named: list[str], truth: bool = False
) -> dict[str, Path]:
    """Folders of trained networks by the model that they correct.

    Args:
        trainings: where the networks are.
        dataset: folder of the dataset that is evaluated.
        run: the run whose extended model is evaluated too, if any.
        named: trainings to use; the newest suitable ones where the list is empty.
        truth: whether the true model is evaluated too.

    Raises:
        Missing: a named training does not exist, is not finished, or has another dataset or run.
    """
    if not named:
        models: list[tuple[str, str | None]] = [("baseline", None)]
        if run:
            models.append(("extended", run))
        if truth:
            models.append(("true", None))
        newest = {model: trainings.newest(dataset, model, of) for model, of in models}
        return {model: folder for model, folder in newest.items() if folder is not None}
    networks = {}
    for name in named:
        request = trainings.request(name)
        if trainings.result(name) is None:
            raise Missing(
                f"training {name} is not finished; wait for it, or resume it", training=name
            )
        same_dataset = request.get("dataset") == str(dataset.resolve())
        if not same_dataset or request.get("run") not in (None, run):
            raise Missing(
                f"training {name} is of another dataset or run; name one of this", training=name
            )
        model = str(request["model"])
        networks[f"{model}:{name}" if model in networks else model] = trainings.folder / name
    return networks
