"""Camera to phantom by hand: numbered pairs of points give a rigid fit, from which ICP starts.

The fit is the closed form of Kabsch (1976) with Umeyama's sign (1991), never a reflection. Pairs
that do not determine the pose (too few, repeated, on one line, mirrored) are rejected with their
numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.rest_fit import refine_rest_cloud
from palpate.registration.robot.robot_fit import rigid_fits
from palpate.registration.uncertainty import NAMES
from palpate.setup.phantom_geometry import Geometry

__all__ = ["PairFit", "PairRegistration", "fit_pairs", "register_pairs"]

REPEATED = 1.0e-3
"""Distance below which points of two pairs count as the same point [m]."""
ON_LINE, NEARLY_ON_LINE = 0.05, 0.15
"""Second over first singular value of the points about their mean below which pairs are rejected,
and below which a warning is given [1]."""
DOUBTFUL = 5.0e-3
"""Residual of a pair beyond which a warning is given [m]; careful clicks miss by 1 to 2 mm."""
MIRRORED = 0.5
"""RMS of a reflection over that of the best motion, below which pairs count as mirrored [1]."""
STRAYED_SHIFT, STRAYED_TURN = 20e-3, math.radians(15.0)
"""Motion by ICP beyond which pairs and surface contradict each other [m], [rad]; three clicks that
miss by 2 mm over 40 mm turn the cloud by 3 degrees."""
COUNTED = 4.0e-3
"""Distance to block or table after ICP up to which points count in the stated residuals [m]."""


@dataclass(frozen=True, eq=False)
class PairFit:
    """The rigid fit of pairs.

    Attributes:
        phantom_from_camera: the fit.
        residuals: (n, 3) [m], phantom frame, cloud point moved by the fit minus its mesh point.
        warnings: for a person.
    """

    phantom_from_camera: Transform
    residuals: FloatArray
    warnings: tuple[str, ...]

    @property
    def misses(self) -> FloatArray:
        """(n,) length of each pair's residual [m]."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    @property
    def rms(self) -> float:
        """Root mean square of the misses [m]."""
        return float(np.sqrt((self.misses**2).mean()))

    def to_json(self) -> dict[str, Any]:
        """Plain values: lengths in metres, the pose as a 4x4 matrix, row major."""
        return {
            "phantom_from_camera": self.phantom_from_camera.matrix.tolist(),
            "residuals": self.misses.tolist(),
            "rms": self.rms,
            "warnings": list(self.warnings),
        }


@dataclass(frozen=True, eq=False)
class PairRegistration:
    """A registration from pairs, refined by ICP.

    Attributes:
        pairs: the rigid fit from which ICP starts.
        camera: the fit to block and table, with covariance and weak directions.
        before: RMS distance of points to block or table at the start [m].
        after: the same of the same points at the end [m].
        points: number of these points.
    """

    pairs: PairFit
    camera: CameraFit
    before: float
    after: float
    points: int

    @property
    def moved(self) -> tuple[float, float]:
        """Motion by ICP: shift of the centre of the block's top [m], and rotation [rad]."""
        motion = self.camera.phantom_from_camera @ self.pairs.phantom_from_camera.inverse()
        pivot = self.camera.pivot
        return float(np.linalg.norm(motion.apply(pivot) - pivot)), float(
            np.linalg.norm(motion.rotation_vector)
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubts about pairs and fit, one sentence each."""
        shift, turn = self.moved
        strayed: tuple[str, ...] = ()
        if shift > STRAYED_SHIFT or turn > STRAYED_TURN:
            strayed = (
                f"ICP moved the cloud by {1e3 * shift:.1f} mm and turned it by "
                f"{math.degrees(turn):.0f} degrees from where the pairs put it (at most "
                f"{1e3 * STRAYED_SHIFT:.0f} mm and {math.degrees(STRAYED_TURN):.0f} degrees "
                "expected): a pair joins the wrong places, or the surface looks alike from there",
            )
        return (*strayed, *self.pairs.warnings, *self.camera.warnings)

    def to_json(self) -> dict[str, Any]:
        """Plain values: lengths in metres, angles in radians, the directions from the weakest to
        the firmest.
        """
        shift, turn = self.moved
        return {
            "pairs": self.pairs.to_json(),
            "phantom_from_camera": self.camera.phantom_from_camera.matrix.tolist(),
            "covariance": self.camera.covariance.tolist(),
            "pivot": self.camera.pivot.tolist(),
            "residual_before": self.before,
            "residual_after": self.after,
            "points": self.points,
            "moved": shift,
            "turned": turn,
            "weak_directions": list(self.camera.weak_directions),
            "directions": directions(self.camera.covariance, self.camera.lever),
            "warnings": list(self.warnings),
        }


def fit_pairs(cloud: FloatArray, mesh: FloatArray) -> PairFit:
    """Fit points on the cloud to their points on the mesh, pair by pair.

    Args:
        cloud: (n, 3) [m], camera frame.
        mesh: (n, 3) [m], phantom frame.

    Raises:
        RegistrationError: for fewer than three, repeated, collinear or mirrored pairs, which are
            numbered from 1.
    """
    cloud, mesh = (
        np.asarray(cloud, dtype=float).reshape(-1, 3),
        np.asarray(mesh, dtype=float).reshape(-1, 3),
    )
    if len(cloud) != len(mesh):
        raise RegistrationError(
            f"{len(cloud)} points on the cloud and {len(mesh)} on the mesh: each pair needs both"
        )
    if len(cloud) < 3:
        raise RegistrationError(
            f"{len(cloud)} pairs found, at least 3 are needed: click further points",
            pairs=len(cloud),
        )
    if not (np.isfinite(cloud).all() and np.isfinite(mesh).all()):
        raise RegistrationError("a pair holds a value that is no number")
    warnings: list[str] = []
    for points, name in ((cloud, "cloud"), (mesh, "mesh")):
        _refuse_repeated(points, name)
        warnings += _check_spread(points, name)
    rotation, translation, rms = rigid_fits(cloud, mesh[None])
    pose = Transform(rotation[0], translation[0])
    _refuse_mirrored(cloud, mesh, pose, float(rms[0]))
    residuals = pose.apply(cloud) - mesh
    misses = np.linalg.norm(residuals, axis=1)
    if misses.max() > DOUBTFUL:
        worst = int(misses.argmax())
        warnings.append(
            f"Pair {worst + 1} misses by {misses[worst] * 1e3:.1f} mm (under {DOUBTFUL * 1e3:.0f} "
            "mm is expected): click it again."
        )
    return PairFit(pose, residuals, tuple(warnings))


def register_pairs(
    rest: FloatArray,
    geometry: Geometry,
    cloud: FloatArray,
    mesh: FloatArray,
    depth_sigma: float = 0.002,
) -> PairRegistration:
    """Fit the pairs (see `fit_pairs`), then register the rest cloud to the phantom from there.

    Args:
        rest: (m, 3) rest cloud [m], camera frame.
        geometry: of the phantom.
        cloud: (n, 3) points of the pairs [m], camera frame.
        mesh: (n, 3) points of the pairs [m], phantom frame.
        depth_sigma: stated accuracy of depth [m].
    """
    pairs = fit_pairs(cloud, mesh)
    camera = refine_rest_cloud(rest, geometry, pairs.phantom_from_camera, depth_sigma)
    left = _distance(camera.phantom_from_camera.apply(rest), geometry)
    counted = left < COUNTED
    before = _distance(pairs.phantom_from_camera.apply(rest[counted]), geometry)
    return PairRegistration(pairs, camera, _rms(before), _rms(left[counted]), int(counted.sum()))


def directions(covariance: FloatArray, lever: float) -> list[dict[str, Any]]:
    """Eigenvectors of a covariance (6, 6) [m, rad], weakest first, with standard deviations [m].

    Rotations are converted to distances at `lever` [m].
    """
    scale = np.array([1.0] * 3 + [lever] * 3)
    values, vectors = np.linalg.eigh(covariance * np.outer(scale, scale))
    return [
        {
            "sigma": float(np.sqrt(max(value, 0.0))),
            "parts": {name: float(part) for name, part in zip(NAMES, vector, strict=True)},
        }
        for value, vector in zip(values[::-1], vectors.T[::-1], strict=True)
    ]


def _refuse_repeated(points: FloatArray, name: str) -> None:
    for i, j in combinations(range(len(points)), 2):
        apart = float(np.linalg.norm(points[i] - points[j]))
        if apart < REPEATED:
            raise RegistrationError(
                f"pairs {i + 1} and {j + 1} have the same point on the {name} ({apart * 1e3:.2f} "
                "mm apart, at least "
                f"{REPEATED * 1e3:.0f} mm is needed): delete one of them",
                pairs=f"{i + 1}, {j + 1}",
            )


def _check_spread(points: FloatArray, name: str) -> list[str]:
    widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    ratio = float(widths[1] / widths[0])
    if ratio < ON_LINE:
        raise RegistrationError(
            f"the points on the {name} lie on one line (width over length {ratio:.3f}, at least "
            f"{ON_LINE} is needed), so the "
            "rotation about it is open: click one aside",
            ratio=ratio,
        )
    if ratio < NEARLY_ON_LINE:
        return [
            f"The points on the {name} lie nearly on one line (width over length {ratio:.2f}): "
            "click one further aside."
        ]
    return []


def _refuse_mirrored(cloud: FloatArray, mesh: FloatArray, pose: Transform, rms: float) -> None:
    """Reject mirrored pairs.

    Points in a plane fit a motion as well as a reflection, but mirrored ones put the camera under
    the table.
    """
    _, _, reflected = rigid_fits(cloud * np.array([1.0, 1.0, -1.0]), mesh[None])
    if rms > 2.0e-3 and reflected[0] < MIRRORED * rms:
        hint, swap = _exchanged(cloud, mesh)
        raise RegistrationError(
            f"the pairs are mirrored: a reflection leaves {reflected[0] * 1e3:.1f} mm RMS, the "
            f"best motion {rms * 1e3:.1f} mm: "
            f"left and right are exchanged between cloud and mesh{hint}",
            rms=rms,
            pairs=swap,
        )
    if pose.translation[2] < 0.0:
        hint, swap = _exchanged(cloud, mesh)
        raise RegistrationError(
            f"the pairs are mirrored: they put the camera {-pose.translation[2] * 1e3:.0f} mm "
            "under the table: the points go round "
            f"the other way on cloud and mesh{hint}",
            height=float(pose.translation[2]),
            pairs=swap,
        )


def _exchanged(cloud: FloatArray, mesh: FloatArray) -> tuple[str, str | None]:
    """Find two mesh points whose exchange makes the pairs fit with the camera over the table.

    Returns:
        the end of a sentence and the numbers of the pairs; empty and None where there are none.
    """
    found: list[tuple[float, str]] = []
    for i, j in combinations(range(len(mesh)), 2):
        order = list(range(len(mesh)))
        order[i], order[j] = j, i
        _, translation, rms = rigid_fits(cloud, mesh[order][None])
        if rms[0] < DOUBTFUL and translation[0][2] > 0.0:
            found.append((float(rms[0]), f"{i + 1}, {j + 1}"))
    if not found:
        return "", None
    pairs = min(found)[1]
    return f"; exchanging the mesh points of pairs {pairs.replace(', ', ' and ')} would fit", pairs


def _distance(points: FloatArray, geometry: Geometry) -> FloatArray:
    """Distance (n,) [m] to the phantom's surface or the table, whichever is nearer."""
    return np.asarray(np.minimum(np.abs(geometry.outside(points)), np.abs(points[:, 2])))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
