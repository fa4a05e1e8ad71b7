"""The long verbs as worker functions: a plain request in, progress out, a plain result back."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.errors import RunError
from core.progress import Report

if TYPE_CHECKING:
    from core.dataset.accepted import Accepted

__all__ = ["TARGETS", "diagnose", "diagnose_into"]

TARGETS = {
    "diagnosis": "app.work:diagnose", "sweep": "app.sweeps:sweep", "training": "app.trainings:train", "import": "app.imports:bring",
    "registration": "app.verbs:register", "replay": "app.verbs:replay", "export": "app.verbs:export",
    "evaluation": "app.evaluations:evaluate",
}  # fmt: skip


def diagnose(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Diagnose `request["dataset"]`; the run folder gets the name of the scratch folder, below `request["runs"]`."""
    from core.dataset.accepted import Accepted  # noqa: PLC0415 (heavy)

    registered = request.get("registration")
    scratch = Path(request["scratch"])
    run = Path(request["runs"]) / scratch.name
    result = diagnose_into(
        Path(request["dataset"]), run, scratch, workers=int(request["workers"]), seed=int(request["seed"]), report=report,
        accepted=Accepted.from_json(registered) if registered else None,
    )  # fmt: skip
    return {"run": run.name, "verdict": result["verdict"]}


def diagnose_into(
    dataset: Path, run: Path, scratch: Path, *, workers: int, seed: int, report: Report, accepted: Accepted | None = None
) -> dict[str, Any]:
    """Diagnose into `scratch`, note the origin, and rename the whole to `run`; returns the report.

    `accepted` is a registration of the camera that is used in place of the automatic one.
    """
    from core.dataset import open_dataset  # noqa: PLC0415 (heavy)
    from core.diagnosis import diagnose as find_cause  # noqa: PLC0415 (heavy)

    if run.exists():
        raise RunError(f"{run} exists already; name another folder or move it away", file=str(run))
    began = time.time()
    made = scratch / run.name
    opened = open_dataset(dataset).registered(accepted)
    result = find_cause(opened, made, workers=workers, report=report, seed=seed)
    splits = {name: split for split in ("train", "validation", "test") for name in getattr(opened.config, split)}
    origin = {
        "dataset": str(dataset.resolve()), "created": began, "seconds": time.time() - began, "seed": seed, "splits": splits
    }  # fmt: skip
    (made / "origin.json").write_text(json.dumps(origin, indent=1))
    run.parent.mkdir(parents=True, exist_ok=True)
    os.rename(made, run)
    return dict(result)
