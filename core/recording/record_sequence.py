"""Recording of one sequence for the page: surfaces, tool and errors of two models, frame by frame.

The models are the stated one and the extended one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Sequence as Recording
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.foundation.arrays import FloatArray
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.metrics import paper_distance
from palpate.measurement.phantom_drift import recorded_camera
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.surface_gaps import Gaps, gaps
from palpate.measurement.tool_pose import ToolShaft, tool_poses
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.interpolation import neighbourhood_means
from palpate.mesh.protocol import Meshing
from palpate.recording.interior_fields import InteriorFields
from palpate.replay.replay import Equilibrium, replay
from palpate.setup.phantom_geometry import Surface
from palpate.setup.setup import Setup

__all__ = ["ModelRecording", "compare_with_clouds", "record"]

MOST_FRAMES = 100
"""Largest number of frames of a recording."""
VERTEX_SPACING = 2.5e-3
"""Spacing of the surface's material vertices [m]."""
_REACH = 3.5e-3
"""Distance from a vertex within which points count [m]."""
_LEAST = 3
"""Smallest number of such points."""


@dataclass(frozen=True, eq=False)
class ModelRecording:
    """One model's part of a recording; arrays over frames (f, ...), SI, phantom frame.

    Attributes:
        surface: (f, v, 3) moved material vertices [m].
        tool: (f, 3) true centre [m].
        error: (f, v) mean gap of the measured points around each vertex [m]; NaN if unseen.
        distance: (f,) RMS of `error` [m].
        paper: (f,) metric of `palpate.measurement.metrics.paper_distance` [m].
        outcome: (f,) 0 for an equilibrium, else 1.
        free: (f,) True without contact.
        force: (f,) size of the block's force on the tool [N].
        iterations: (f,) of the solver.
        inside: interior fields.
    """

    surface: FloatArray
    tool: FloatArray
    error: FloatArray
    distance: FloatArray
    paper: FloatArray
    outcome: FloatArray
    free: FloatArray
    force: FloatArray
    iterations: FloatArray
    inside: InteriorFields


def _vertex_errors(seen: Gaps, surface: Surface) -> FloatArray:
    """Mean gap (v,) [m] of the points around each vertex on its own side; NaN for too few
    points.
    """
    # Points on another side of an edge are near in space but carry no information on this side.
    errors = np.full(len(surface.vertices), np.nan)
    for number in np.unique(seen.side):
        own = np.unique(surface.faces[surface.side == number])
        here = seen.side == number
        errors[own] = neighbourhood_means(
            surface.vertices[own], seen.foot[here], seen.gap[here], _REACH, _LEAST
        )
    return errors


def _rms(errors: FloatArray) -> float:
    """RMS of the finite errors (v,) [m].

    They are averages: single points would show little but the sensor's noise.
    """
    seen = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else np.nan


def compare_with_clouds(
    setup: Setup,
    frames: Sequence[Equilibrium],
    clouds: Sequence[FloatArray],
    other: tuple[Setup, ModelRecording] | None = None,
) -> ModelRecording:
    """Compare frames of a setup with segmented clouds.

    Args:
        setup: of the frames.
        frames: equilibria.
        clouds: (n, 3) each, camera frame [m].
        other: another setup and its recording; frames at rest, half of all, are copied from it if
            both setups look the same at rest.
    """
    surface, sight = setup.surface(VERTEX_SPACING), camera_model_for(setup)
    known = other[1] if other is not None and _looks_alike(other[0], setup) else None
    moved, errors, distance, paper = [], [], [], []
    for number, (frame, cloud) in enumerate(zip(frames, clouds, strict=True)):
        moved.append(frame.move(surface.vertices))
        if known is not None and frame.at_rest and np.array_equal(known.surface[number], moved[-1]):
            errors.append(known.error[number])
            distance.append(float(known.distance[number]))
            paper.append(float(known.paper[number]))
            continue
        points = sight.place(cloud)
        errors.append(_vertex_errors(gaps(points, sight.pose.translation, frame, surface), surface))
        distance.append(_rms(errors[-1]))
        paper.append(paper_distance(points[::2], frame, surface))
    return ModelRecording(
        np.array(moved),
        np.array([frame.tool.centre for frame in frames]),
        np.array(errors),
        np.array(distance),
        np.array(paper),
        np.array([frame.outcome.code for frame in frames], dtype=np.int8),
        np.array([not frame.in_contact for frame in frames]),
        np.array([np.linalg.norm(frame.force) for frame in frames]),
        np.array([frame.iterations for frame in frames], dtype=np.int32),
        InteriorFields.of(setup, frames),
    )


def _looks_alike(one: Setup, other: Setup) -> bool:
    """Whether an untouched block and a cloud look the same in both setups."""
    return camera_model_for(one).same(camera_model_for(other)) and (
        one.geometry,
        one.registered,
        one.cast,
    ) == (other.geometry, other.registered, other.cast)


def record(
    sequence: Recording,
    stated: Setup,
    extended: Setup,
    cleaner: Cleaner,
    shaft: ToolShaft | None,
    grid: Meshing,
    target: Path,
) -> str:
    """Replay one sequence with both models and write the recording; returns the sequence's name.

    Args:
        sequence: of the dataset.
        stated: setup of the model "raw".
        extended: setup of the model "extended".
        cleaner: segmentation of the phantom; the tools of both models are removed.
        shaft: of the tool, in its frame; None if unknown.
        grid: mesh specification.
        target: file to write.
    """
    total = len(sequence)
    index = np.unique(np.linspace(0, total - 1, min(total, MOST_FRAMES)).round().astype(int))
    times = np.asarray(sequence.cloud_times)[index]
    poses = tool_poses(sequence.kinematics, times, stated.phantom_from_robot, shaft)
    cleaner = cleaner.allowing(extended.tool.radius)
    raw = [sequence.cloud(int(i)) for i in index]
    clouds = [
        cloud[cleaner.clean(cloud, pose).indices] for cloud, pose in zip(raw, poses, strict=True)
    ]
    models = _replayed_models(sequence, stated, extended, grid, times, clouds)
    cameras: dict[str, Any] = {
        f"camera_{model}": recorded_camera(sequence, camera_model_for(setup).pose).matrix
        for model, setup in (("raw", stated), ("extended", extended))
    }
    radii: dict[str, Any] = {
        f"tool_radius_{model}": np.array(setup.tool.radius)
        for model, setup in (("raw", stated), ("extended", extended))
    }
    surface = stated.surface(VERTEX_SPACING)
    np.savez_compressed(
        target,
        time=times,
        cloud_index=index,
        faces=surface.faces,
        rest=surface.vertices.astype(np.float32),
        **cameras,
        **radii,
        **_model_arrays(models),
    )
    return sequence.name


def _replayed_models(
    sequence: Recording,
    stated: Setup,
    extended: Setup,
    grid: Meshing,
    times: FloatArray,
    clouds: Sequence[FloatArray],
) -> dict[str, ModelRecording]:
    """Replay the frames at these times (f,) [s] with both models, named "raw" and "extended"."""
    models: dict[str, ModelRecording] = {}
    frames: list[Equilibrium] = []
    for model, setup in (("raw", stated), ("extended", extended)):
        if models and extended is stated:
            models[model] = models["raw"]
            continue
        robot = touch_correction(setup, grid) @ setup.phantom_from_robot
        centres = robot.apply(smooth_centres(sequence.kinematics, times - setup.sensor.time_offset))
        # A setup with history is replayed in the order of time, from frame to frame.
        starts = None if setup.has_history else frames or None
        frames = replay(
            setup,
            centres,
            grid,
            times=times - setup.sensor.time_offset,
            starts=starts,
            tolerance=1e-3,
        )
        models[model] = compare_with_clouds(
            setup, frames, clouds, (stated, models["raw"]) if models else None
        )
    return models


def _model_arrays(models: Mapping[str, ModelRecording]) -> dict[str, Any]:
    """Arrays of both models for the file of a recording."""
    before, after = models["raw"], models["extended"]
    floor = after.distance[after.free] if after.free.any() else after.distance
    arrays: dict[str, Any] = {
        "noise_floor": np.array(float(np.nanmean(floor))),
        "outcome": np.maximum(before.outcome, after.outcome),
    }
    for name, model in models.items():
        arrays |= {
            name: model.surface.astype(np.float32),
            f"tool_{name}": model.tool,
            f"error_{name}": model.error.astype(np.float32),
            f"distance_{name}": model.distance,
            f"paper_{name}": model.paper,
            f"outcome_{name}": model.outcome,
            f"force_{name}": model.force,
            f"iterations_{name}": model.iterations,
            **model.inside.arrays(name),
        }
    return arrays
