"""Where the block stood when a sequence began: a base that slid stays where it is, and so does a
block that somebody nudged.

The rest cloud is taken once, before anything is pushed. Each sequence's frames before its first
touch show by how much the block lies elsewhere on the table by then. It is a measurement and no
hypothesis: every model, the stated one as well, is compared with the sequence as seen from the
block where it stood. What slides within a sequence is left to be explained.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.dataset import Dataset, Sequence
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.patch_averages import PatchMeans, patch_means
from palpate.measurement.segmentation import Cleaner, cleaner_for, find_shaft_axis, tool_poses
from palpate.measurement.surface_gaps import Surface, gaps
from palpate.mesh.graded_mesh import SCREEN_GRID
from palpate.registration.registration import Registration, setup_from
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import rest
from palpate.setup.setup import Setup, Shape

__all__ = ["PhantomDrift", "align_sequences", "measure_drift", "recorded_camera", "shift_sequences"]

LEAST, SURE = 1.5e-4, 5.0
"""Less than this [m], or than so many standard deviations, is no displacement."""
_FRAMES = 8
"""Untouched frames that are looked at."""
_CLEAR = 1.5e-3
"""A tool farther than this from the stated block [m] does not touch it."""
_ROUNDS = 3
_ALONG_TABLE, _EXPLAINED = 0.25, 0.8
"""A block that moved over the table rises by less than this share of its way; and that way is most
of what has changed in it. A camera that was moved makes other changes too."""
_DOUBT, _NEVER = 1.5e-4, 1e30
"""A direction that no side shows this exactly [m] counts as unseen; the weight that holds it."""
_FEWEST, _PATCH = 12, 8e-3
"""Patches that must be seen both then and now, and their edge [m]: of a side at a low angle a cloud
has few points."""
_GRAZING = 0.12
"""Cosine between ray and normal from which a point counts: a side that is seen at a low angle tells
best where it lies, for the error is along the ray."""


@dataclass(frozen=True, eq=False)
class PhantomDrift:
    """How far the block lies from where the rest cloud shows it as a sequence begins.

    Attributes:
        way: (3,) along x, y, z [m], zero along what no side shows.
        deviation: (3,) standard deviations [m].
        explained: share of the changes beyond noise that its way along the table accounts for [1].
    """

    way: FloatArray
    deviation: FloatArray
    explained: float


def align_sequences(dataset: Dataset, registration: Registration) -> tuple[Dataset, Registration]:
    """The dataset with each sequence as seen from the block where it stood; its registration warns
    where that is elsewhere.
    """
    found = measure_drift(dataset, registration)
    if not found:
        return dataset, registration
    rows = ", ".join(f"{name} by {1e3 * np.linalg.norm(way):.1f} mm" for name, way in found.items())
    told = (
        f"The block does not lie where rest.ply shows it as these begin: {rows}. It slid before, or was moved; each is compared "
        "from where it lay."
    )
    return shift_sequences(dataset, registration, found), replace(
        registration, warnings=(*registration.warnings, told)
    )


def shift_sequences(
    dataset: Dataset, registration: Registration, ways: Mapping[str, FloatArray]
) -> Dataset:
    """The dataset with these sequences as seen from a block that lies `ways` (2,) [m] along x and y
    from where it was.
    """
    return replace(
        dataset,
        loaded=tuple(
            _shift_sequence(one, registration, ways.get(one.name)) for one in dataset.loaded
        ),
    )


def recorded_camera(sequence: Sequence, pose: Transform) -> Transform:
    """The camera's pose that puts clouds as they were recorded beside the block as the sequence is
    seen from it.
    """
    return pose if sequence.shift is None else pose @ Transform(translation=sequence.shift)


def _shift_sequence(
    sequence: Sequence, registration: Registration, way: FloatArray | None
) -> Sequence:
    if way is None:
        return sequence
    back = -np.append(way, 0.0)
    # Where touches were of other landmarks, which way the robot's axes point is what the mended
    # ones say.
    robot = registration.repaired.phantom_from_robot
    return sequence.moved(
        registration.phantom_from_camera.inverse().rotate(back), robot.inverse().rotate(back)
    )


def measure_drift(dataset: Dataset, registration: Registration) -> dict[str, FloatArray]:
    """How far (2,) along x and y [m] the block lies from where the rest cloud shows it, of each
    sequence where it surely does.

    Counted from the sequence in which it lies nearest: by what all are displaced, the camera was
    moved and not the block.
    """
    if isinstance(dataset.geometry, Shape) or not dataset.has_rest:
        return {}
    repaired = registration.repaired
    setup = setup_from(dataset, repaired)
    cleaner, shaft = cleaner_for(dataset, repaired), find_shaft_axis(dataset, repaired)
    bare, surface = (
        rest(setup, SCREEN_GRID.for_tool(setup.tool.radius)),
        replace(Surface.of(setup), patch=_PATCH),
    )
    cloud = dataset.rest_cloud()
    before = _means(setup, cloud[cleaner.clean(cloud).indices], np.zeros(3), bare, surface)
    found: dict[str, PhantomDrift] = {}
    for name in dataset.sequences:
        points = _untouched_points(dataset.sequence(name), setup, cleaner, shaft)
        one = _fit_drift(setup, points, before, bare, surface) if len(points) else None
        if one is not None:
            found[name] = one
    return _significant(found)


def _significant(found: Mapping[str, PhantomDrift]) -> dict[str, FloatArray]:
    if len(found) < 2:
        return {}
    nearest = min(found.values(), key=lambda one: float(np.linalg.norm(one.way)))
    sure: dict[str, FloatArray] = {}
    for name, one in found.items():
        way, deviation = one.way - nearest.way, np.hypot(one.deviation, nearest.deviation)
        flat = np.where(np.abs(way[:2]) > SURE * deviation[:2], way[:2], 0.0)
        far = float(np.linalg.norm(flat))
        if far > LEAST and abs(way[2]) < _ALONG_TABLE * far and one.explained > _EXPLAINED:
            sure[name] = flat
    return sure


def _untouched_points(
    sequence: Sequence, setup: Setup, cleaner: Cleaner, shaft: FloatArray | None
) -> FloatArray:
    """Cleaned points (n, 3) [m], camera frame, of frames before the tool first comes near the
    block; none where there is none.
    """
    times = np.asarray(sequence.cloud_times)
    if not len(times):
        return np.empty((0, 3))
    centres = setup.phantom_from_robot.apply(sequence.kinematics.position_at(times))
    apart = np.linalg.norm(centres - setup.box.nearest(centres), axis=1)
    near = apart <= setup.tool.radius + _CLEAR
    early = np.arange(int(near.argmax()) if near.any() else len(times))
    if not len(early):
        return np.empty((0, 3))
    chosen = early[
        np.unique(np.linspace(0, len(early) - 1, min(len(early), _FRAMES)).round().astype(int))
    ]
    poses = tool_poses(sequence.kinematics, times[chosen], setup.phantom_from_robot, shaft)
    raw = [sequence.cloud(int(index)) for index in chosen]
    return np.concatenate(
        [cloud[cleaner.clean(cloud, pose).indices] for cloud, pose in zip(raw, poses, strict=True)]
    )


def _means(
    setup: Setup, points: FloatArray, way: FloatArray, bare: Equilibrium, surface: Surface
) -> PatchMeans:
    """Of cleaned points (n, 3) [m], camera frame, against the block moved by `way` (3,) [m]."""
    pose = setup.phantom_from_camera
    seen = gaps(pose.apply(points) - way, pose.translation - way, bare, surface, grazing=_GRAZING)
    return patch_means(seen.gap, seen.patch, surface.patches)


def _fit_drift(
    setup: Setup, points: FloatArray, before: PatchMeans, bare: Equilibrium, surface: Surface
) -> PhantomDrift | None:
    """By least squares: a side that moved by d along its normal n has its points n d farther
    out."""
    way, first = np.zeros(3), 1.0
    for number in range(_ROUNDS):
        now = _means(setup, points, way, bare, surface)
        seen = np.isfinite(now.mean) & np.isfinite(before.mean)
        if seen.sum() < _FEWEST:
            return None
        change, rows = (now.mean - before.mean)[seen], surface.patch_normals[seen]
        noise = float(np.median(np.concatenate([now.spread[seen], before.spread[seen]]))) ** 2
        weight = 1 / (noise * (1 / now.count[seen] + 1 / before.count[seen]))
        left = float((weight * change**2).mean())
        first = left if number == 0 else first
        matrix = (rows * weight[:, None]).T @ rows
        matrix += np.diag(np.where(np.diag(matrix) < _DOUBT**-2, _NEVER, 0.0))
        step = np.linalg.solve(matrix, (rows * weight[:, None]).T @ change)
        if number < _ROUNDS - 1:  # the last round says what the way along the table has left
            way[:2] += step[:2]
    explained = 1.0 - max(left - 1.0, 0.0) / max(first - 1.0, 1e-9)
    return PhantomDrift(
        np.append(way[:2], step[2]), np.sqrt(np.diag(np.linalg.inv(matrix))), explained
    )
