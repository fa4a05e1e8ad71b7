"""Displacement of the block on its table between the rest cloud and the begin of each sequence.

A base that slid, or a block that somebody moved, stays where it is. The rest cloud is taken once,
before any push. The frames of a sequence before its first touch show the displacement since then.
It is a measurement, not a hypothesis: all models, also the stated one, are compared with the
sequence relative to the displaced block. Slip within a sequence is left to the models.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.dataset import Dataset, Sequence
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.patch_averages import PatchMeans, patch_means
from palpate.measurement.segmentation import Cleaner, cleaner_for
from palpate.measurement.surface_gaps import gaps
from palpate.measurement.tool_pose import ToolShaft, find_shaft, tool_poses
from palpate.mesh.default_meshes import Use, default_mesh
from palpate.mesh.protocol import Meshing
from palpate.registration.registration import Registration, setup_from
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import rest
from palpate.setup.phantom_geometry import Surface
from palpate.setup.setup import Setup

__all__ = ["PhantomDrift", "align_sequences", "measure_drift", "recorded_camera", "shift_sequences"]

LEAST, SURE = 1.5e-4, 5.0
"""Smallest displacement [m], and smallest number of standard deviations, that are significant."""
_FRAMES = 8
"""Largest number of untouched frames that are used."""
_CLEAR = 1.5e-3
"""Distance between tool and stated block beyond which the block counts as untouched [m]."""
_ROUNDS = 3
"""Number of Gauss-Newton steps."""
_ALONG_TABLE, _EXPLAINED = 0.25, 0.8
"""Largest rise over the way along the table [1], and least share of the change that the way
explains [1]. A camera that was moved causes other changes too."""
_DOUBT, _NEVER = 1.5e-4, 1e30
"""Standard deviation from which a direction counts as undetermined [m], and the weight that fixes
it."""
_FEWEST, _PATCH = 12, 8e-3
"""Least number of patches that are visible both times, and their edge [m]. The patches are large
because a cloud has few points of a side at a low angle."""
_GRAZING = 0.12
"""Least cosine between ray and normal of a point [1]. Sides at a low angle are included: the error
is along the ray, so they determine their position best."""


@dataclass(frozen=True, eq=False)
class PhantomDrift:
    """Displacement of the block since the rest cloud, at the begin of a sequence.

    Attributes:
        way: (3,) along x, y, z [m], zero along undetermined directions.
        deviation: (3,) standard deviations [m].
        explained: share of the changes beyond noise that the way along the table explains [1].
    """

    way: FloatArray
    deviation: FloatArray
    explained: float


def align_sequences(dataset: Dataset, registration: Registration) -> tuple[Dataset, Registration]:
    """Move each sequence so that the block lies where the rest cloud shows it.

    Returns:
        the dataset, and the registration with a warning that names displaced sequences.
    """
    found = measure_drift(dataset, registration)
    if not found:
        return dataset, registration
    rows = ", ".join(f"{name} by {1e3 * np.linalg.norm(way):.1f} mm" for name, way in found.items())
    message = (
        f"The phantom does not lie where rest.ply shows it as these begin: {rows}. It slid before, "
        "or was moved; each is compared from where it lay."
    )
    return shift_sequences(dataset, registration, found), replace(
        registration, warnings=(*registration.warnings, message)
    )


def shift_sequences(
    dataset: Dataset, registration: Registration, ways: Mapping[str, FloatArray]
) -> Dataset:
    """Move sequences back by `ways` (2,) [m] along x and y, by name of the sequence."""
    return replace(
        dataset,
        loaded=tuple(
            _shift_sequence(one, registration, ways.get(one.name)) for one in dataset.loaded
        ),
    )


def recorded_camera(sequence: Sequence, pose: Transform) -> Transform:
    """The camera's pose for clouds as recorded, where the sequence has been shifted."""
    return pose if sequence.shift is None else pose @ Transform(translation=sequence.shift)


def _shift_sequence(
    sequence: Sequence, registration: Registration, way: FloatArray | None
) -> Sequence:
    if way is None:
        return sequence
    back = -np.append(way, 0.0)
    # Touches that were paired with wrong landmarks give wrong directions of the robot's axes.
    robot = registration.repaired.phantom_from_robot
    return sequence.moved(
        registration.phantom_from_camera.inverse().rotate(back), robot.inverse().rotate(back)
    )


def measure_drift(dataset: Dataset, registration: Registration) -> dict[str, FloatArray]:
    """Measure the significant displacements (2,) [m] along x and y of the block, by sequence.

    They are relative to the sequence with the smallest one: a displacement common to all is a
    motion of the camera, not of the block.
    """
    if not dataset.has_rest:
        return {}
    repaired = registration.repaired
    setup = setup_from(dataset, repaired)
    cleaner, shaft = cleaner_for(dataset, repaired), find_shaft(dataset, repaired)
    bare, surface = (rest(setup, _resting_mesh(setup)), setup.surface(patch=_PATCH))
    cloud = dataset.rest_cloud()
    before = _means(setup, cloud[cleaner.clean(cloud).indices], np.zeros(3), bare, surface)
    found: dict[str, PhantomDrift] = {}
    for name in dataset.sequences:
        points = _untouched_points(dataset.sequence(name), setup, cleaner, shaft)
        one = _fit_drift(setup, points, before, bare, surface) if len(points) else None
        if one is not None:
            found[name] = one
    return _significant(found)


def _resting_mesh(setup: Setup) -> Meshing:
    """A mesh of the untouched phantom, for its sag."""
    top = np.array([[0.0, 0.0, setup.geometry.height]])
    return default_mesh(Use.SCREEN, setup.geometry, setup.tool.radius, top)


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
    sequence: Sequence, setup: Setup, cleaner: Cleaner, shaft: ToolShaft | None
) -> FloatArray:
    """Segmented points (n, 3) [m], camera frame, of frames before the tool first comes near."""
    times = np.asarray(sequence.cloud_times)
    if not len(times):
        return np.empty((0, 3))
    centres = setup.phantom_from_robot.apply(sequence.kinematics.position_at(times))
    apart = setup.geometry.distance(centres)
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
    """Average distances of segmented points (n, 3) [m], camera frame, to the block moved by `way`
    (3,) [m].
    """
    pose = setup.phantom_from_camera
    seen = gaps(pose.apply(points) - way, pose.translation - way, bare, surface, grazing=_GRAZING)
    return patch_means(seen.gap, seen.patch, surface.patches)


def _fit_drift(
    setup: Setup, points: FloatArray, before: PatchMeans, bare: Equilibrium, surface: Surface
) -> PhantomDrift | None:
    """Fit the displacement by least squares; a side with normal n moves outwards by n d.

    None where too few patches are visible both times.
    """
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
        if number < _ROUNDS - 1:  # the last step gives what the way along the table leaves
            way[:2] += step[:2]
    explained = 1.0 - max(left - 1.0, 0.0) / max(first - 1.0, 1e-9)
    return PhantomDrift(
        np.append(way[:2], step[2]), np.sqrt(np.diag(np.linalg.inv(matrix))), explained
    )
