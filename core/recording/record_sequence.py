"""What the page shows of one sequence: surfaces, tool and errors of the stated and of the extended
model, frame by frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.dataset import Sequence as Recording
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.metrics import paper_distance
from palpate.measurement.phantom_drift import recorded_camera
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.surface_gaps import Gaps, Surface, gaps
from palpate.measurement.tool_pose import tool_poses
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.interpolation import neighbourhood_means
from palpate.mesh.protocol import Meshing
from palpate.recording.interior_fields import InteriorFields
from palpate.replay.replay import Equilibrium, replay
from palpate.setup.setup import Setup

__all__ = ["ModelRecording", "compare_with_clouds", "record"]

MOST_FRAMES = 100
VERTEX_SPACING = 2.5e-3
_REACH = 3.5e-3
_LEAST = 3


@dataclass(frozen=True, eq=False)
class ModelRecording:
    """One model's side of a recording; arrays over frames (f, ...), SI, phantom frame.

    `distance` is the RMS of `error`, `force` the size of the block's force on the tool.
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
    """Mean gap (v,) [m] of the points around each material vertex on its own side; NaN where too
    few were seen.
    """
    # Points on another side of an edge are near in space but say nothing of this side.
    errors = np.full(len(surface.vertices), np.nan)
    for number in np.unique(seen.side):
        own = np.unique(surface.faces[surface.side == number])
        here = seen.side == number
        errors[own] = neighbourhood_means(
            surface.vertices[own], seen.foot[here], seen.gap[here], _REACH, _LEAST
        )
    return errors


def _rms(errors: FloatArray) -> float:
    """Over what was seen, of errors (v,) [m] that are averages already: single points would show
    little but the sensor's noise.
    """
    seen = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else np.nan


def compare_with_clouds(
    setup: Setup,
    frames: Sequence[Equilibrium],
    clouds: Sequence[FloatArray],
    other: tuple[Setup, ModelRecording] | None = None,
) -> ModelRecording:
    """These frames of a setup against cleaned clouds, (n, 3) each, camera frame [m].

    Frames at rest, which are half of them, need not be looked at again where the `other` setup has
    looked at the same block from the same place.
    """
    surface, sight = Surface.of(setup, VERTEX_SPACING), camera_model_for(setup)
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
        np.array(
            [0 if frame.outcome is Outcome.CONVERGED else 1 for frame in frames], dtype=np.int8
        ),
        np.array([not frame.in_contact for frame in frames]),
        np.array([np.linalg.norm(frame.force) for frame in frames]),
        np.array([frame.iterations for frame in frames], dtype=np.int32),
        InteriorFields.of(setup, frames),
    )


def _looks_alike(one: Setup, other: Setup) -> bool:
    """Whether an untouched block and a cloud look the same in both setups."""
    return camera_model_for(one).same(camera_model_for(other)) and (one.box, one.registered) == (
        other.box,
        other.registered,
    )


def record(
    sequence: Recording,
    stated: Setup,
    found: Setup,
    cleaner: Cleaner,
    shaft: FloatArray | None,
    grid: Meshing,
    target: Path,
) -> str:
    """Replay one sequence under both models and write `target`; returns the sequence's name."""
    total = len(sequence)
    index = np.unique(np.linspace(0, total - 1, min(total, MOST_FRAMES)).round().astype(int))
    times = np.asarray(sequence.cloud_times)[index]
    poses = tool_poses(sequence.kinematics, times, stated.phantom_from_robot, shaft)
    raw = [sequence.cloud(int(i)) for i in index]
    clouds = [
        cloud[cleaner.clean(cloud, pose).indices] for cloud, pose in zip(raw, poses, strict=True)
    ]
    sides: dict[str, ModelRecording] = {}
    frames: list[Equilibrium] = []
    for model, setup in (("raw", stated), ("extended", found)):
        if sides and found is stated:
            sides[model] = sides["raw"]
            continue
        robot = touch_correction(setup, grid) @ setup.phantom_from_robot
        centres = robot.apply(smooth_centres(sequence.kinematics, times - setup.sensor.time_offset))
        # What hangs on the past is replayed in the order of time, and from frame to frame.
        starts = None if setup.has_history else frames or None
        frames = replay(
            setup,
            centres,
            grid,
            times=times - setup.sensor.time_offset,
            starts=starts,
            tolerance=1e-3,
        )
        sides[model] = compare_with_clouds(
            setup, frames, clouds, (stated, sides["raw"]) if sides else None
        )
    before, after = sides["raw"], sides["extended"]
    surface = Surface.of(stated, VERTEX_SPACING)
    floor = after.distance[after.free] if after.free.any() else after.distance
    np.savez_compressed(
        target,
        time=times,
        cloud_index=index,
        faces=surface.faces,
        rest=surface.vertices.astype(np.float32),
        raw=before.surface.astype(np.float32),
        extended=after.surface.astype(np.float32),
        tool_raw=before.tool,
        tool_extended=after.tool,
        tool_radius_raw=np.array(stated.tool.radius),
        tool_radius_extended=np.array(found.tool.radius),
        error_raw=before.error.astype(np.float32),
        error_extended=after.error.astype(np.float32),
        distance_raw=before.distance,
        distance_extended=after.distance,
        paper_raw=before.paper,
        paper_extended=after.paper,
        noise_floor=np.array(float(np.nanmean(floor))),
        camera_raw=recorded_camera(sequence, camera_model_for(stated).pose).matrix,
        camera_extended=recorded_camera(sequence, camera_model_for(found).pose).matrix,
        outcome=np.maximum(before.outcome, after.outcome),
        **{
            f"{key}_{model}": getattr(side, key)
            for model, side in sides.items()
            for key in ("outcome", "force", "iterations")
        },
        **before.inside.arrays("raw"),
        **after.inside.arrays("extended"),
    )
    return sequence.name
