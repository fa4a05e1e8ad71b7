"""Series of each frame of a replayed sequence: push depth, contact, forces and worst frames."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np

from palpate.app.reporting.json_values import finite
from palpate.app.storage.run_store import RecordedReplay, Run
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import PalpateError

__all__ = [
    "by_model",
    "contact_force",
    "models_of",
    "push_depth",
    "timeline_series",
    "touching",
    "worst_frames",
]

log = logging.getLogger(__name__)
MODELS = ("raw", "extended", "corrected")
MOST_WORST = 3
FLAT = 2.0e-4
"""Largest distance of a vertex of a box from its faces [m]."""


def timeline_series(run: Run, replay: RecordedReplay) -> dict[str, Any]:
    """All series of a sequence for the timeline; null where the data or the run do not contain
    them.

    `depth` [m], the measured `force` [N], and by model `forces` [N] and `iterations` have one
    number for each frame; `touching` has first and last frames of the contact spells, `worst`
    frames with contact in the order of their raw error, `failed` by model the frames without
    equilibrium.
    """
    depth, force = push_depth(replay), contact_force(run, replay)
    iterations, forces = by_model(replay, "iterations"), by_model(replay, "force")
    return {
        "models": list(models_of(replay)),
        "depth": finite(depth, digits=7),
        "touching": touching(depth),
        "force": None if force is None else finite(force, digits=5),
        "forces": {name: finite(values, digits=5) for name, values in forces.items()} or None,
        "iterations": {
            name: [int(count) for count in counts] for name, counts in iterations.items()
        }
        or None,
        "failed": {
            name: [int(at) for at in np.flatnonzero(codes)]
            for name, codes in by_model(replay, "outcome").items()
        },
        "reasons": {
            name: [Outcome.reason(int(code)) for code in codes if code]
            for name, codes in by_model(replay, "outcome").items()
        },
        "worst": worst_frames(np.where(depth > 0, replay["distance_raw"], np.nan)),
    }


def by_model(replay: RecordedReplay, key: str) -> dict[str, Any]:
    """A series (f,) of each model that has it in the run."""
    return {
        name: replay.arrays[f"{key}_{name}"] for name in MODELS if f"{key}_{name}" in replay.arrays
    }


def models_of(replay: RecordedReplay) -> tuple[str, ...]:
    """Models whose surface and errors the run contains; few runs have `corrected`."""
    return tuple(
        name
        for name in MODELS
        if all(f"{key}{name}" in replay.arrays for key in ("", "error_", "distance_"))
    )


def push_depth(replay: RecordedReplay) -> FloatArray:
    """Penetration of the raw model's tool into the block at rest (f,) [m], 0 apart from it.

    It is radius minus the signed distance of the tool's centre to the free surface; what is held is
    no way out.
    """
    rest = np.asarray(replay["rest"], dtype=float)
    low, high = rest.min(axis=0), rest.max(axis=0)
    apart = np.minimum(np.abs(rest - low), np.abs(rest - high)).min(axis=1)
    centres = np.asarray(replay["tool_raw"], dtype=float)
    if apart.max() > FLAT:
        distance = _beyond_surface(centres, rest, np.asarray(replay["faces"], dtype=np.int64))
    else:
        distance = _beyond_box(centres, low - np.array([0.0, 0.0, 1.0]), high)
    return np.asarray(np.maximum(float(replay["tool_radius_raw"]) - distance, 0.0))


def _beyond_box(centres: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Signed distance (f,) [m] of places (f, 3) to a box, negative inside."""
    beyond = np.abs(centres - (low + high) / 2) - (high - low) / 2
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))


def _beyond_surface(centres: FloatArray, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Signed distance (f,) [m] of places (f, 3) to triangles, negative behind them."""
    from palpate.setup.free_form.closest_point import nearest

    corners = vertices[faces]
    number, places = nearest(centres, corners)
    a, b, c = corners[number].transpose(1, 0, 2)
    behind = np.einsum("fi,fi->f", centres - places, np.cross(b - a, c - a)) < 0
    distance = np.linalg.norm(centres - places, axis=1)
    return np.asarray(np.where(behind, -distance, distance))


def touching(depth: FloatArray) -> list[list[int]]:
    """First and last frame of each spell with a depth (f,) [m] above zero."""
    edges = np.diff(np.concatenate([[0], (depth > 0).astype(int), [0]]))
    return [
        [int(first), int(after) - 1]
        for first, after in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)
    ]


def contact_force(run: Run, replay: RecordedReplay) -> FloatArray | None:
    """Magnitude of the measured force on the tool (f,) [N] at the frames, NaN outside the
    recording; None without forces.
    """
    from palpate.dataset import open_dataset

    folder = run.origin.get("dataset")
    if folder is None or not Path(folder).is_dir():
        return None
    try:
        forces = open_dataset(Path(folder)).sequence(replay.name).forces
    except PalpateError as error:
        log.warning("run %s: the measured forces are not shown: %s", run.name, error.message)
        return None
    if forces is None:
        return None
    size = np.linalg.norm(forces.force, axis=1)
    return np.asarray(np.interp(replay["time"], forces.time, size, left=np.nan, right=np.nan))


def worst_frames(errors: FloatArray, most: int = MOST_WORST) -> list[int]:
    """Peaks of an error (f,), the highest first; none within a twelfth of the sequence of a higher
    one.
    """
    seen = np.where(np.isfinite(errors), errors, -np.inf)
    around = np.concatenate([[-np.inf], seen, [-np.inf]])
    peaks = np.flatnonzero((seen >= around[:-2]) & (seen >= around[2:]) & np.isfinite(seen))
    chosen: list[int] = []
    for frame in peaks[np.argsort(-seen[peaks], kind="stable")]:
        if all(abs(int(frame) - other) > len(seen) // 12 for other in chosen):
            chosen.append(int(frame))
    return chosen[:most]
