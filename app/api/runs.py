"""Finished diagnoses: reports, patterns, pictures, and values of each frame."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse, HTMLResponse

from palpate.app.drawing.colours import nice_limit
from palpate.app.drawing.free_surface import HeightMap
from palpate.app.drawing.view import Quantity
from palpate.app.reporting.json_values import finite
from palpate.app.reporting.model_comparison import compared
from palpate.app.reporting.report_tables import chance, limit_rows, ranking_note, ranking_rows
from palpate.app.reporting.sentences import registration_sentences, verdict_sentence
from palpate.app.reporting.stiffness_sentences import stiffness_sentences
from palpate.app.reporting.timeline_series import timeline_series
from palpate.app.scene.model_layer import NO_INSIDE
from palpate.app.server.pagination import RequestedPage, paginate
from palpate.app.services import CurrentServices
from palpate.app.storage.result_store import DAMAGED
from palpate.app.storage.run_store import RecordedReplay, Run

__all__ = ["router"]

router = APIRouter(prefix="/runs", tags=["runs"])


@router.get("")
def listed(
    services: CurrentServices, response: Response, page: RequestedPage
) -> list[dict[str, Any]]:
    """Runs, the newest first, each with its verdict, or `unreadable`. The header X-Total-Count has
    their number.
    """
    shown = paginate(services.runs.all(), page, response)
    return [heading for run in shown if (heading := _listed(run)) is not None]


@router.get("/{name}")
def one(name: str, services: CurrentServices) -> dict[str, Any]:
    """One run: verdict sentence, ranking and detection limits as texts, phantom, and for each
    sequence its split and both models' errors [m] in the raw model's worst frame.
    """
    run = services.runs.get(name)
    replays = [run.replay(sequence) for sequence in run.sequences]
    size = [round(float(edge), 6) for edge in replays[0].size] if replays else None
    return {
        **_heading(run),
        "sentence": verdict_sentence(run.report, size),
        "notes": registration_sentences(run.report),
        "stiffness": stiffness_sentences(run.report),
        "ranking": [asdict(row) for row in ranking_rows(run.report)],
        "ranking_note": ranking_note(run.report),
        "limits": [asdict(row) for row in limit_rows(run.report)],
        "chances": [chance(cause.get("probability")) for cause in run.report.get("causes", [])],
        "size": size,
        "has_clouds": Path(run.origin.get("dataset", "")).is_dir() and "dataset" in run.origin,
        "sequences": [
            {
                "name": replay.name,
                "frames": len(replay),
                "seconds": round(float(replay["time"][-1] - replay["time"][0]), 3)
                if len(replay)
                else 0.0,
                "split": run.origin.get("splits", {}).get(replay.name),
                **_worst(replay),
            }
            for replay in replays
        ],
    }


@router.get("/{name}/report")
def report(name: str, services: CurrentServices) -> dict[str, Any]:
    """The report, as written."""
    return services.runs.get(name).report


@router.get(
    "/{name}/report.html",
    response_class=Response,
    responses={200: {"content": {"text/html": {"schema": {"type": "string"}}}}},
)
def page(name: str, services: CurrentServices) -> HTMLResponse:
    """The report as one self-contained HTML file."""
    from palpate.app.reporting.report_page import report_page

    text = report_page(services.runs.get(name))
    return HTMLResponse(
        text, headers={"content-disposition": f'attachment; filename="{name}.html"'}
    )


@router.get("/{name}/comparison")
def comparison(
    name: str, services: CurrentServices, beside: Annotated[tuple[str, ...], Query()] = ()
) -> dict[str, Any]:
    """Errors [m] of this run's models by sequence, next to those of the runs in `beside`, which
    must have the same dataset.
    """
    return compared([services.runs.get(one) for one in dict.fromkeys([name, *beside])])


@router.get("/{name}/model")
def model(name: str, services: CurrentServices) -> dict[str, Any]:
    """The extended model with its lineage."""
    return services.runs.get(name).model


@router.get("/{name}/patterns")
def patterns(name: str, services: CurrentServices) -> dict[str, Any]:
    """Patches with the measured and predicted error pattern [m], null where unseen; `limit` is the
    end of their common scale.
    """
    arrays = services.runs.get(name).patterns()
    values = {
        key: finite(arrays[key], digits=7)
        for key in ("centres", "normals", "measured", "predicted")
    }
    return {
        **values,
        "limit": nice_limit(np.concatenate([arrays["measured"], arrays["predicted"]])),
    }


@router.get(
    "/{name}/pictures/{picture}",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}}},
)
def picture(name: str, picture: str, services: CurrentServices) -> FileResponse:
    """A picture of the run."""
    return FileResponse(services.runs.get(name).picture(picture))


@router.get("/{name}/sequences/{sequence}")
def sequence(name: str, sequence: str, services: CurrentServices) -> dict[str, Any]:
    """Times [s], errors [m], push depth [m], force [N] and contact spells of each frame, and what
    the scene can show.

    `limits` are the robust ends of the scales, null where the run does not contain a quantity;
    `inside` says why the interior is missing; `height_map` has the heights [m] of the free surface
    seen from above, rows along y, null where there is none.
    """
    renderer = services.sessions.renderer(name, sequence)
    replay = renderer.replay
    timeline = timeline_series(services.runs.get(name), replay)
    series = [
        f"{key}_{model}"
        for key in ("distance", "paper")
        for model in timeline["models"]
        if f"{key}_{model}" in replay.arrays
    ]
    return {
        "name": sequence,
        "time": finite(replay["time"] - replay["time"][0], digits=5),
        **{key: finite(replay[key], digits=8) for key in series},
        "noise_floor": finite(replay["noise_floor"]),
        "outcome": [int(code) for code in replay["outcome"]],
        "limits": {quantity: renderer.end(quantity) for quantity in get_args(Quantity)},
        "inside": NO_INSIDE if renderer.end("energy") is None else None,
        "lumps": renderer.lumps + renderer.mapped,
        "landmarks": renderer.landmarks,
        "box": [[round(float(x), 6) for x in corner] for corner in renderer.corners],
        "height_map": _height_map(renderer.body.height_map),
        **timeline,
    }


def _height_map(found: HeightMap) -> dict[str, Any]:
    """Plain values of a map, SI."""
    return {
        "corner": finite(found.corner, digits=6),
        "spacing": finite(found.spacing, digits=7),
        "heights": finite(found.heights, digits=6),
    }


def _worst(replay: RecordedReplay) -> dict[str, Any]:
    """Errors [m] of both models in the frame in which the raw model's is largest."""
    keys = ("distance_raw", "distance_extended")
    seen = np.flatnonzero(np.isfinite(replay[keys[0]]))
    if not len(seen):
        return dict.fromkeys(keys)
    frame = seen[np.argmax(replay[keys[0]][seen])]
    return {key: finite(replay[key][frame]) for key in keys}


def _listed(run: Run) -> dict[str, Any] | None:
    """The line of a run in a list; None where it was deleted while the list was made."""
    try:
        return _heading(run)
    except (*DAMAGED, FileNotFoundError):
        try:
            changed = run.path.stat().st_mtime
        except FileNotFoundError:
            return None
        return {
            "id": run.name,
            "dataset": "?",
            "folder": None,
            "verdict": "unreadable",
            "causes": [],
            "created": changed,
            "data_changed": None,
        }


def _heading(run: Run) -> dict[str, Any]:
    from palpate.dataset.provenance import data_changed

    report, dataset = run.report, run.origin.get("dataset")
    return {
        "id": run.name,
        "dataset": report.get("dataset", "?"),
        "folder": Path(dataset).name if dataset else None,
        "verdict": report.get("verdict", "?"),
        "causes": [cause["effect"] for cause in report.get("causes", [])],
        "created": run.origin.get("created", run.path.stat().st_mtime),
        "data_changed": data_changed(Path(dataset), run.origin.get("made_from", {}))
        if dataset
        else None,
    }
