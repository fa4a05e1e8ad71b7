"""Functions of the shorter jobs: register, replay, and export."""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.app.http_errors import Conflict
from palpate.app.storage.registration_store import RegistrationStore
from palpate.app.storage.run_store import EXPORTS, Run, RunStore
from palpate.foundation.errors import RegistrationError
from palpate.foundation.progress import Report, part

if TYPE_CHECKING:
    from palpate.dataset import Dataset

__all__ = ["export", "register", "replay"]


def register(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Register robot, camera and phantom of `request["dataset"]`, and store the camera's
    registration under a name.
    """
    from palpate.dataset import open_dataset
    from palpate.dataset.accepted_registration import rest_digest
    from palpate.registration.registration import register as relate

    dataset = open_dataset(Path(request["dataset"]))
    registration = relate(dataset, report)
    camera = registration.camera
    if camera is None:
        raise RegistrationError(
            "the dataset has no clouds, so that there is no camera to register", file="rest.ply"
        )
    pose = {
        "phantom_from_camera": camera.phantom_from_camera.matrix.tolist(),
        "covariance": camera.covariance.tolist(),
        "pivot": camera.pivot.tolist(),
        "residual_after": camera.rms,
        "weak_directions": list(camera.weak_directions),
        "warnings": list(registration.warnings),
        "phantom_from_robot": registration.phantom_from_robot.matrix.tolist(),
        "touch_rms": registration.touch_rms,
    }
    stored = {"points": [], "registration": pose, "rest": rest_digest(dataset.path)}
    name = str(request["name"])
    registrations = RegistrationStore(Path(request["runs"]), name)
    if request.get("accept"):
        accepted = str(request["accept"])
        registrations.save(accepted, stored)
    else:
        accepted = _save_under_free_name(registrations, stored)
    return {
        "dataset": name,
        "registration": accepted,
        "weak_directions": list(camera.weak_directions),
    }


def _save_under_free_name(registrations: RegistrationStore, stored: dict[str, Any]) -> str:
    for number in range(1, 10_000):
        try:
            registrations.save(f"automatic-{number}", stored)
        except Conflict:
            continue
        return f"automatic-{number}"
    raise Conflict(
        f"{registrations.dataset} has too many registrations called automatic-...: name this one",
        dataset=registrations.dataset,
    )


def replay(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Replay chosen sequences with the stated setup and with the requested effects; the result is a
    run.

    A repeated job whose first attempt was interrupted after its run was in place returns that run.
    """
    from palpate.dataset import open_dataset
    from palpate.dataset.accepted_registration import AcceptedRegistration
    from palpate.dataset.provenance import made_from
    from palpate.recording.replay_run import replay_into
    from palpate.recording.saved_model import effects_from

    registered, scratch = request.get("registration"), Path(request["scratch"])
    run, began, since = Path(request["runs"]) / scratch.name, time.time(), time.monotonic()
    if run.is_dir():
        written = json.loads((run / "origin.json").read_text())
        return {"run": run.name, "frames_without_equilibrium": written["unsolved"]}
    dataset = open_dataset(Path(request["dataset"])).registered(
        AcceptedRegistration.from_json(registered) if registered else None
    )
    sources = made_from(dataset.path)
    made = scratch / run.name
    failed = replay_into(
        dataset,
        made,
        request["sequences"],
        effects_from(request["effects"]),
        workers=int(request["workers"]),
        report=report,
    )
    (made / "origin.json").write_text(
        json.dumps(
            {
                **_origin(dataset),
                "created": began,
                "seconds": time.monotonic() - since,
                "made_from": sources,
                "unsolved": failed,
            },
            indent=1,
        )
    )
    os.rename(made, run)
    return {"run": run.name, "frames_without_equilibrium": failed}


def _origin(dataset: Dataset) -> dict[str, Any]:
    splits = {
        name: split
        for split in ("train", "validation", "test")
        for name in getattr(dataset.config, split)
    }
    return {"dataset": str(dataset.path.resolve()), "seed": 0, "splits": splits}


def export(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """Write the requested parts of a run, or a registration, as files."""
    runs, scratch = Path(request["runs"]), Path(request["scratch"])
    folder, made = runs / EXPORTS / scratch.name, scratch / "files"
    if folder.is_dir():  # the first attempt was interrupted after this
        return {"export": folder.name, "files": sorted(path.name for path in folder.iterdir())}
    made.mkdir(parents=True)
    if request.get("registration"):
        stored = RegistrationStore(runs, request["name"]).request(request["registration"])
        (made / f"{request['name']}-{request['registration']}.json").write_text(
            json.dumps(stored, indent=1)
        )
    if request.get("run"):
        _export_run(
            RunStore(runs).get(request["run"]), request["what"], made, part(report, 0.1, 0.9)
        )
    folder.parent.mkdir(parents=True, exist_ok=True)
    files = sorted(path.name for path in made.iterdir())
    os.rename(made, folder)
    return {"export": scratch.name, "files": files}


def _export_run(run: Run, what: list[str], made: Path, report: Report) -> None:
    from palpate.app.reporting.report_page import report_page

    if "report" in what:
        report(0.0, "writing the report")
        (made / f"{run.name}.html").write_text(report_page(run))
        (made / f"{run.name}-report.json").write_text(json.dumps(run.report, indent=1))
    if "model" in what:
        (made / f"{run.name}-model.json").write_text(json.dumps(run.model, indent=1))
    if "replays" in what:
        report(0.3, "packing the replays")
        shutil.make_archive(str(made / f"{run.name}-replays"), "zip", run.path, "replays")
