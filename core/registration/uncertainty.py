"""Uncertainty of a pose from points on planes, with a smooth error of the sensor.

The error of a depth camera is white noise plus a bias that changes smoothly over the image.
Neighbouring points share the bias; treating them as independent underestimates the covariance
several times. Patch averages are therefore fitted by generalised least squares with covariance
sigma^2 / n + b^2 exp(-d^2 / 2 L^2) along the line of sight. Size b and length L of the bias are
averaged over, weighted by their evidence (Rasmussen and Williams 2006, section 2.7: explicit basis
functions, wide prior).

A soft block sags and bulges, and a table does not. The block's faces may therefore be offset from
their stated planes as a whole: not, a little or much, weighted in the same way. Where top and table
agree this changes little; where they do not, the table determines the pose. Without a table the
block is the only reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from palpate.foundation.arrays import FloatArray
from palpate.foundation.threads import on_one_thread
from palpate.registration.faces import FACES, Assignment, IndexArray
from palpate.registration.pose import motion_jacobian

__all__ = ["PRIOR", "Patches", "PoseEstimate", "estimate", "make_patches", "weak_directions"]

PRIOR = np.array([0.01] * 3 + [np.radians(10.0)] * 3)
"""Prior standard deviations [m, rad] about the first guess."""
BIAS_SIZES = np.array([0.02, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7, 1.0]) * 1e-3
"""Sizes b of the bias that are averaged over [m]."""
BIAS_USUAL = 0.5e-3
"""Scale of the half-normal prior of b [m]."""
TOP_OFFSETS, OFFSET_ODDS = (0.0, 0.5e-3, 2.0e-3), 0.15
"""Offsets of the top that are averaged over [m], and prior odds of one that is not zero [1]."""
BIAS_REACHES = (0.008, 0.016, 0.03, 0.06)
"""Lengths L of the bias that are averaged over [m]."""
WEAK = 0.5e-3
"""Standard deviation from which a direction is weak [m]."""
NAMES = (
    "translation along x",
    "translation along y",
    "translation along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
)


@dataclass(frozen=True, eq=False)
class Patches:
    """Averages over cells of 8 mm on each part of the surface, seen through one camera.

    Attributes:
        face: (p,) part of the surface, which may be offset as a whole.
        sag: (p,) its offset where the top sags by one [1]; zero on the table.
        distance: (p,) from the plane [m], positive outside.
        jacobian: (p, 6) of the distance.
        variance: (p,) white noise variance of the distance [m^2].
        slant: (p,) distance per error along the line of sight [1].
        place: (p, 3) position on a sphere of the mean range [m].
        noise: white noise along the line of sight [m].
    """

    face: IndexArray
    sag: FloatArray
    distance: FloatArray
    jacobian: FloatArray
    variance: FloatArray
    slant: FloatArray
    place: FloatArray
    noise: float


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """Correction of a pose.

    Attributes:
        motion: (6,) [m, rad] that remains.
        covariance: (6, 6) of the motion.
        bias: size of the sensor's smooth error [m].
    """

    motion: FloatArray
    covariance: FloatArray
    bias: float

    def settled(self, lever: float) -> FloatArray:
        """The motion (6,) without its part along weak directions.

        Args:
            lever: distance at which rotations are converted [m].
        """
        scale = np.array([1.0] * 3 + [lever] * 3)
        values, vectors = np.linalg.eigh(self.covariance * np.outer(scale, scale))
        firm = vectors[:, np.sqrt(values) <= WEAK]
        return np.asarray(firm @ (firm.T @ (self.motion * scale)) / scale)


def make_patches(
    found: Assignment, weights: FloatArray, camera: FloatArray, pivot: FloatArray
) -> Patches:
    """Average points over patches.

    Args:
        found: points on planes.
        weights: (k,) robust weights.
        camera: (3,) [m], phantom frame.
        pivot: (3,) of the motions [m].
    """
    patch = _patch_of(found)
    total = np.maximum(np.bincount(patch, weights), 1e-9)
    sight = found.points - camera
    reach = np.linalg.norm(sight, axis=1)

    def mean(values: FloatArray) -> FloatArray:
        columns = values.reshape(len(values), -1)
        return np.column_stack(
            [np.bincount(patch, weights * column) / total for column in columns.T]
        )

    jacobian = np.einsum("ki,kij->kj", found.normals, motion_jacobian(found.points, pivot))
    slant, distance = mean(found.slant)[:, 0], mean(found.distance)[:, 0]
    # The scatter within patches has no part from the bias or from offsets of faces.
    local = (
        (found.distance - distance[patch])
        / found.slant
        * np.sqrt(total / np.maximum(total - 1, 0.5))[patch]
    )
    noise = max(
        1.0e-5,
        1.4826 * float(np.median(np.abs(local[total[patch] > 3]))) if (total > 3).any() else 1.0e-3,
    )
    heavy = total > 2.0
    return Patches(
        np.round(mean(found.face.astype(float))[heavy, 0]).astype(np.int64),
        mean(found.sag)[heavy, 0],
        distance[heavy],
        mean(jacobian)[heavy],
        ((noise * slant) ** 2 / total)[heavy],
        slant[heavy],
        mean(sight / reach[:, None] * reach.mean())[heavy],
        noise,
    )


def _patch_of(found: Assignment) -> IndexArray:
    """Patch number (k,) of each point."""
    cells = np.column_stack([found.face, found.cell])
    return np.asarray(np.unique(cells, axis=0, return_inverse=True)[1]).ravel()


@on_one_thread
def estimate(patches: Patches) -> PoseEstimate:
    """Estimate the motion that remains after a fit, with a covariance that includes smooth sensor
    bias and offsets of the block's faces.
    """
    distance = np.linalg.norm(patches.place[:, None] - patches.place[None], axis=2)
    has_table = bool((patches.sag == 0).any())
    models = []
    for offset in TOP_OFFSETS if has_table else TOP_OFFSETS[:1]:
        fixed = np.diag(patches.variance) + _shape_covariance(patches, offset)
        for reach in BIAS_REACHES:
            kernel = (
                np.exp(-0.5 * (distance / reach) ** 2)
                * patches.slant[:, None]
                * patches.slant[None]
            )
            models += [
                (*_fit_patches(patches, fixed + bias**2 * kernel, bias), bias, offset)
                for bias in BIAS_SIZES
            ]
    evidence = np.array([model[0] + (np.log(OFFSET_ODDS) if model[4] else 0.0) for model in models])
    weights = np.exp(evidence - evidence.max())
    weights /= weights.sum()
    motions = np.array([model[1] for model in models])
    motion = weights @ motions
    spread = motions - motion
    covariance = (
        np.einsum("m,mij->ij", weights, np.array([model[2] for model in models]))
        + (spread.T * weights) @ spread
    )
    return PoseEstimate(
        motion, covariance, float(weights @ np.array([model[3] for model in models]))
    )


def _shape_covariance(patches: Patches, top_offset: float) -> FloatArray:
    """Covariance (p, p) [m^2] of patches by offsets of whole parts; the table has none."""
    sizes, face = patches.sag * top_offset, patches.face
    return np.where(face[:, None] == face[None], sizes[:, None] * sizes[None], 0.0)


def _fit_patches(
    patches: Patches, noise: FloatArray, bias: float
) -> tuple[float, FloatArray, FloatArray]:
    """Log evidence of a noise covariance (p, p) [m^2], the fitted motion (6,) and its covariance
    (6, 6).
    """
    a, r = patches.jacobian, patches.distance
    factor = cho_factor(noise)
    weighted = cho_solve(factor, np.column_stack([a, r]))
    information = a.T @ weighted[:, :6] + np.diag(1 / PRIOR**2)
    covariance = np.asarray(np.linalg.inv(information), dtype=float)
    motion = -covariance @ (a.T @ weighted[:, 6])
    misfit = float(r @ weighted[:, 6] - motion @ information @ motion) + (bias / BIAS_USUAL) ** 2
    log_determinants = 2 * np.log(np.diag(factor[0])).sum() + np.linalg.slogdet(information)[1]
    return -0.5 * (misfit + float(log_determinants)), motion, covariance


def weak_directions(
    covariance: FloatArray, counts: dict[str, int], lever: float
) -> tuple[str, ...]:
    """Sentences about weak directions of a pose.

    A direction is weak with a standard deviation over 0.5 mm, and open where the data hardly
    improve on the first guess.

    Args:
        covariance: (6, 6) [m, rad].
        counts: points on each face.
        lever: distance at which rotations are converted [m].
    """
    scale = np.array([1.0] * 3 + [lever] * 3)
    values, vectors = np.linalg.eigh(covariance * np.outer(scale, scale))
    sentences = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if np.sqrt(value) > WEAK:
            sentences.append(
                _weak_sentence(
                    float(np.sqrt(value)),
                    vector,
                    counts,
                    lever,
                    float(np.abs(vector) @ (PRIOR * scale)),
                )
            )
    return tuple(sentences)


def _weak_sentence(
    sigma: float, vector: FloatArray, counts: dict[str, int], lever: float, known: float
) -> str:
    main = [k for k in np.argsort(-np.abs(vector)) if abs(vector[k]) > 0.4]
    what = " with ".join(NAMES[k] for k in main)
    amount = f"{sigma * 1e3:.1f} mm" if main[0] < 3 else f"{np.degrees(sigma / lever):.1f} degrees"
    if sigma > 0.4 * known:
        return f"{what} is open ({_reason(main, counts)}) and kept at the first guess"
    return f"{what} is weak, +- {amount} ({_reason(main, counts)})"


def _reason(main: list[int], counts: dict[str, int]) -> str:
    """Words on the faces that would determine these parameters, and their numbers of points."""
    if "surface" in counts:
        table = f"{counts['table']} points on the table" if "table" in counts else "no table"
        return f"{counts['surface']} points on the surface, {table}"
    faces = {
        0: ("-x", "+x"),
        1: ("-y", "+y"),
        2: ("top", "table"),
        3: ("top", "table"),
        4: ("top", "table"),
        5: ("-x", "+x", "-y", "+y"),
    }
    needed = sorted({face for k in main for face in faces[int(k)]}, key=FACES.index)
    seen = [f"{counts[face]} points on {face}" for face in needed if counts.get(face)]
    return ", ".join(seen) + " alone" if seen else "no points on " + " or ".join(needed)
