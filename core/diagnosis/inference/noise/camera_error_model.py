"""The camera's own errors in a cloud of the untouched block, from that cloud alone.

Any camera has an error that is smooth over the image, which is no finding. Depth that waves with
the distance is a finding: interference and the sampling of a modulated light cause it (the wiggling
error of Lindner, Schiller, Kolb and Koch 2010). It is no deformation, no effect of the catalogue
removes it, and it moves over a surface that moves. The model separates what equal distances have in
common all over the cloud (top, sides and table) from what neighbours have in common.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray

__all__ = ["CALM", "CameraErrors", "Ripple", "camera_errors"]

BIAS_SIZES = np.array(CRITERIA.camera_error.bias_sizes)
BIAS_REACHES = np.array(CRITERIA.camera_error.bias_lengths)
WHITE_FACTORS = np.array(CRITERIA.camera_error.scatter_factors)
RIPPLE_SIZES = np.array(CRITERIA.camera_error.ripple_sizes)
RIPPLE_REACHES = np.array(CRITERIA.camera_error.ripple_lengths)


@dataclass(frozen=True)
class Ripple:
    """Depth that waves with the distance.

    Attributes:
        size: standard deviation [m].
        reach: correlation length along the distance [m].
        gain: of a model with waves over one without [nats].
        share: of the camera's variance beyond scatter [1].
    """

    size: float
    reach: float
    gain: float
    share: float

    @property
    def significant(self) -> bool:
        """Whether the gain is large enough for a finding."""
        return self.gain > CRITERIA.camera_error.least_ripple_gain

    @property
    def warning(self) -> str:
        """Sentence about the waves; empty without a finding."""
        if not self.significant:
            return ""
        return (
            "rest.ply: depth waves with the distance from the camera, by about "
            f"{self.size * 1e3:.2g} mm (RMS), alike over {self.reach * 1e3:.2g} mm of distance, on "
            f"top, sides and table together ({self.gain:.0f} nats, "
            f"{CRITERIA.camera_error.least_ripple_gain:.0f} are asked): no effect of the catalogue "
            "does that; calibrate the camera's depth, or look for another camera's light"
        )


CALM = Ripple(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class CameraErrors:
    """Errors of the camera in a cloud.

    Attributes:
        covariance: (n, n) [m^2].
        bias: standard deviation of the smooth bias [m].
        reach: its correlation length [m].
        ripple: waves of depth, significant or not.
        cast_gain: of a model in which the body has an offset, over one in which only the camera
            errs [nats].
    """

    covariance: FloatArray
    bias: float
    reach: float
    ripple: Ripple
    cast_gain: float = 0.0


def camera_errors(
    places: FloatArray,
    depth: FloatArray,
    white: FloatArray,
    residual: FloatArray,
    free: FloatArray,
    form: FloatArray | None = None,
) -> CameraErrors:
    """Estimate the camera's errors by restricted maximum likelihood (Patterson and Thompson 1971).

    Waves are part of the covariance only where they are significant. An offset of the body looks
    like an error of the camera, but the table has none: where a model with both is surely better,
    the covariance is that of the camera's share. Raises LinAlgError where no model is positive
    definite.

    Args:
        places: points (n, 3) [m].
        depth: distance of the points from the camera (n,) [m].
        white: variance of the scatter there (n,) [m^2].
        residual: (n,) [m].
        free: columns (n, c) whose share of the residual is left out.
        form: covariance (n, n) of an offset of the body [m^2]; None for a body that has none.
    """
    scale = np.linalg.norm(free, axis=0)
    basis, sizes, _ = np.linalg.svd(free[:, scale > 0] / scale[scale > 0], full_matrices=False)
    cloud = _Cloud(places, depth, white, residual, basis[:, sizes > 1e-6 * sizes[0]])
    plain = _best(cloud)
    if not np.isfinite(plain[0]):
        raise np.linalg.LinAlgError("no model of the camera's errors is positive definite")
    value, waving = _climb(cloud)
    size, reach, bias = RIPPLE_SIZES[waving[3]], RIPPLE_REACHES[waving[4]], BIAS_SIZES[waving[1]]
    ripple = Ripple(
        float(size), float(reach), value - plain[0], float(size**2 / (size**2 + bias**2))
    )
    best = waving if ripple.significant else plain[1]
    cast_gain = 0.0
    if form is not None and not ripple.significant:
        gain, beside = _best(cloud, form)
        cast_gain = gain - plain[0]
        best = beside if cast_gain > CRITERIA.camera_error.least_cast_gain else best
    size, reach = float(BIAS_SIZES[best[1]]), float(BIAS_REACHES[best[0]])
    return CameraErrors(cloud.covariance(best), size, reach, ripple, cast_gain)


def _best(cloud: _Cloud, form: FloatArray | None = None) -> tuple[float, tuple[int, ...]]:
    """Return likelihood [nats] and indices of the best model without waves.

    Args:
        cloud: to be explained.
        form: covariance (n, n) of an offset of the body [m^2]; None without one.
    """
    shapes = product(range(len(BIAS_REACHES)), range(len(BIAS_SIZES)), range(len(WHITE_FACTORS)))
    tried = [
        (cloud.likelihood(shape) if form is None else cloud.value(cloud.covariance(shape) + form))
        for shape in shapes
    ]
    place = int(np.argmax(tried))
    shape = np.unravel_index(place, (len(BIAS_REACHES), len(BIAS_SIZES), len(WHITE_FACTORS)))
    return float(tried[place]), tuple(int(index) for index in shape)


def _climb(cloud: _Cloud) -> tuple[float, tuple[int, ...]]:
    """Return likelihood [nats] and indices of the best model with waves, by coordinate ascent."""
    grid = (BIAS_REACHES, BIAS_SIZES, WHITE_FACTORS, RIPPLE_SIZES, RIPPLE_REACHES)
    best: tuple[int, ...] = (3, 2, 0, 1, 1)
    value, before = cloud.likelihood(best), -np.inf
    while value > before:
        before = value
        for axis, choices in enumerate(grid):
            for place in range(
                CRITERIA.camera_error.first_smooth_length if axis == 0 else 0, len(choices)
            ):
                trial = (*best[:axis], place, *best[axis + 1 :])
                if (found := cloud.likelihood(trial)) > value:
                    value, best = found, trial
    return value, best


class _Cloud:
    """The likelihood of the models of a grid for one cloud."""

    def __init__(
        self,
        places: FloatArray,
        depth: FloatArray,
        white: FloatArray,
        residual: FloatArray,
        basis: FloatArray,
    ) -> None:
        self._white, self._residual, self._basis = white, residual, basis
        distance = np.linalg.norm(places[:, None] - places, axis=2)
        self._near = [np.exp(-0.5 * (distance / reach) ** 2) for reach in BIAS_REACHES]
        self._alike = [
            np.exp(-0.5 * ((depth[:, None] - depth) / reach) ** 2) for reach in RIPPLE_REACHES
        ]
        self._known: dict[tuple[int, ...], float] = {}

    def covariance(self, model: tuple[int, ...]) -> FloatArray:
        """Return the covariance (n, n) [m^2] of a model.

        Args:
            model: indices of the bias's length, size and scatter factor, and of the waves' size and
                length.
        """
        reach, size, factor, *waves = model
        covariance = BIAS_SIZES[size] ** 2 * self._near[reach] + np.diag(
            WHITE_FACTORS[factor] * self._white + CRITERIA.camera_error.white_floor**2
        )
        if waves:
            covariance = covariance + RIPPLE_SIZES[waves[0]] ** 2 * self._alike[waves[1]]
        return np.asarray(covariance)

    def likelihood(self, model: tuple[int, ...]) -> float:
        """Return the restricted log likelihood of a model, up to a constant [nats]."""
        if model not in self._known:
            self._known[model] = self.value(self.covariance(model))
        return self._known[model]

    def value(self, covariance: FloatArray) -> float:
        """Return the restricted log likelihood of a covariance (n, n) [m^2], as `likelihood`."""
        factor = cho_factor(covariance)
        solved = cho_solve(factor, np.column_stack([self._basis, self._residual]))
        information, right = self._basis.T @ solved[:, :-1], self._basis.T @ solved[:, -1]
        misfit = self._residual @ solved[:, -1] - right @ np.linalg.solve(information, right)
        determinants = 2 * np.log(np.diag(factor[0])).sum() + np.linalg.slogdet(information)[1]
        return float(-0.5 * (misfit + determinants))
