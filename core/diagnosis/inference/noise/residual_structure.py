"""Test for structure in the residuals: a part that is smooth and grows with the push.

The whitened residual of each sequence is projected on smooth surface modes times the depth of the
push. The same projection of draws from the noise model, with the nuisances fitted anew in each,
gives the amount by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import gamma

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, draw_rights
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import smooth_basis
from palpate.foundation.arrays import FloatArray

__all__ = [
    "NOTHING",
    "Structure",
    "explained_by_modes",
    "push_sizes",
    "response_of_modes",
    "rms_beyond_noise",
    "structure_of",
]


@dataclass(frozen=True)
class Structure:
    """Squared whitened residual along the modes.

    Attributes:
        value: of the data.
        expected: mean by chance.
        bound: value that chance exceeds once in a thousand times.
        amplitude: size of a smooth error that gives as much beyond chance, RMS over the visible
            surface in frames with contact [m]; NaN where forces alone show it.
        motion: RMS displacement of that surface in those frames [m].
    """

    value: float
    expected: float
    bound: float
    amplitude: float = np.nan
    motion: float = np.nan

    @property
    def ratio(self) -> float:
        """Value over the mean by chance, about one when nothing is wrong."""
        return self.value / self.expected

    @property
    def significant(self) -> bool:
        """Whether the value is above the bound."""
        return self.value > self.bound

    def matters(self, tolerance: Tolerance) -> bool:
        """Whether it is significant and not known to be within the tolerance."""
        return self.significant and not self.amplitude <= tolerance.of(self.motion)


NOTHING = Structure(0.0, 1.0, 1.0)


def push_sizes(item: Prediction) -> FloatArray:
    """The largest displacement of each group (g,) over that of the sequence [1]."""
    size = np.array(
        [
            np.linalg.norm(frame.displacement, axis=1).max() if frame.in_contact else 0.0
            for frame in item.equilibria
        ]
    )
    return np.asarray(size / max(size.max(), 1e-9))


def _with_modes(model: Model, evaluator: Evaluator) -> list[Block]:
    """Return the model's blocks with the modes as last columns."""
    seen = (
        smooth_basis(evaluator.problem.surface.patch_centres, CRITERIA.structure.mode_length)
        if evaluator.problem.clouds
        else np.zeros((0, 0))
    )
    forces = (
        smooth_basis(evaluator.problem.pushes[0], CRITERIA.structure.force_mode_length)
        if len(evaluator.problem.pushes[0])
        else np.zeros((0, 0))
    )
    blocks, at = [], 0
    for noise, item in zip(evaluator.state.noises, model.predictions, strict=True):
        modes = max(seen.shape[1], forces.shape[1])
        if item.forces is not None and item.force_only:
            push = np.asarray(item.forces.push)
            names = np.unique(push)
            own = forces[at + np.searchsorted(names, push)]
            at += len(names)
            force = _wide(item.forces.force[:, :, None] * own[:, None, :], modes)
            blocks.append(noise.block(item.append_columns(np.zeros((len(own), 0, modes)), force)))
        else:
            blocks.append(
                noise.block(
                    item.append_columns(_wide(push_sizes(item)[:, None, None] * seen, modes))
                )
            )
    return blocks


def _wide(columns: FloatArray, count: int) -> FloatArray:
    """Return columns (..., count), filled up with zeros, so that all blocks have as many."""
    missing = count - columns.shape[-1]
    return (
        np.concatenate([columns, np.zeros((*columns.shape[:-1], missing))], axis=-1)
        if missing
        else columns
    )


def explained_by_modes(
    blocks: Sequence[Block],
    rights: FloatArray,
    fitted: Sequence[int],
    precision: FloatArray,
    modes: Sequence[int],
) -> FloatArray:
    """Return what modes explain (d,) after the fitted columns.

    Args:
        blocks: of data.
        rights: right sides (d, b, k).
        fitted: columns that are fitted to all blocks together.
        precision: of their prior (f, f).
        modes: columns of which each block has its own factors.
    """
    index, own = np.asarray(fitted), np.asarray(modes)
    grams = np.array([block.gram[1:, 1:] for block in blocks])
    total = grams[:, index[:, None], index].sum(axis=0) + precision
    factors = -np.linalg.solve(total, rights[:, :, index].sum(axis=1).T).T
    found = np.zeros(len(rights))
    for number, matrix in enumerate(grams):
        left = rights[:, number, own] + factors @ matrix[np.ix_(index, own)]
        inner = matrix[np.ix_(own, own)]
        inner = inner + CRITERIA.structure.least_precision * np.diag(inner).max() * np.eye(len(own))
        found += np.einsum("di,ij,dj->d", left, np.linalg.inv(inner), left)
    return found


def structure_of(evaluator: Evaluator, model: Model, seed: int) -> Structure:
    """Return the structure that a model leaves; `seed` is that of the draws."""
    blocks = _with_modes(model, evaluator)
    size = blocks[0].gram.shape[0] - 1
    first = model.predictions[0].columns.shape[2]
    fitted = [*model.nuisance[:-1], size - 1, *model.columns]  # the mesh's error is the last column
    precision = evaluator.bounded_precision(model)
    modes = range(first, size - 1)
    depth, motion = _pushed(evaluator, model)
    data = np.array([[block.gram[1:, 0] for block in blocks]])
    rights = draw_rights(
        blocks, fitted, precision, CRITERIA.structure.draws, np.random.default_rng(seed)
    )
    value = float(explained_by_modes(blocks, data, fitted, precision, modes)[0])
    chance = explained_by_modes(blocks, rights, fitted, precision, modes)
    mean, variance = float(chance.mean()), float(chance.var(ddof=1))
    response = response_of_modes(blocks, fitted, precision, modes)
    amplitude = depth * float(np.sqrt(max(value - mean, 0.0) / response))
    return Structure(
        value,
        mean,
        float(gamma.ppf(CRITERIA.structure.quantile, mean**2 / variance, scale=variance / mean)),
        amplitude,
        motion,
    )


def rms_beyond_noise(evaluator: Evaluator, model: Model) -> float:
    """RMS of a model's error beyond noise over the visible surface [m]; NaN without clouds."""
    if not evaluator.problem.clouds:
        return np.nan
    patches = evaluator.problem.surface.patches
    weights = np.concatenate(
        [
            noise.weights[:, :patches].ravel()
            for noise, item in zip(evaluator.state.noises, model.predictions, strict=True)
            if not item.force_only
        ]
    )
    excess = max(evaluator.misfit(model) - 1.0, 0.0)
    return float(np.sqrt(excess * (weights > 0).sum() / max(weights.sum(), 1e-300)))


def _pushed(evaluator: Evaluator, model: Model) -> tuple[float, float]:
    """RMS of `push_sizes` [1] and of the visible surface's displacement [m] over the groups with
    contact; NaN where a sequence has no clouds.
    """
    centres = evaluator.problem.surface.patch_centres if evaluator.problem.clouds else None
    depths, ways = [], []
    for item in model.predictions:
        if centres is None or item.force_only:
            return np.nan, np.nan
        for depth, frame, gap in zip(push_sizes(item), item.equilibria, item.gap, strict=True):
            seen = np.isfinite(gap)
            if frame.in_contact and seen.any():
                depths.append(depth)
                ways.append(np.linalg.norm(frame.move(centres[seen]) - centres[seen], axis=1))
    if not depths:
        return np.nan, np.nan
    return (
        float(np.sqrt(np.mean(np.square(depths)))),
        float(np.sqrt(np.mean(np.concatenate(ways) ** 2))),
    )


def response_of_modes(
    blocks: Sequence[Block], fitted: Sequence[int], precision: FloatArray, modes: Sequence[int]
) -> float:
    """Expected value of `explained_by_modes` for mode factors of unit variance without noise.

    Of smooth error with such factors the fitted columns take their part: L is what is left of it in
    the right sides of the modes, and the value is L^T A^-1 L with the modes' own matrices A.
    """
    index, own, count = np.asarray(fitted), np.asarray(modes), len(blocks)
    grams = np.array([block.gram[1:, 1:] for block in blocks])
    total = np.linalg.inv(grams[:, index[:, None], index].sum(axis=0) + precision)
    cross = grams[:, index[:, None], own]
    response = 0.0
    inner = []
    for matrix in grams:
        part = matrix[np.ix_(own, own)]
        least = CRITERIA.structure.least_precision * np.diag(part).max()
        inner.append(np.linalg.inv(part + least * np.eye(len(own))))
    for row in range(count):
        for column in range(count):
            left = -cross[row].T @ total @ cross[column]
            if row == column:
                left = left + grams[row][np.ix_(own, own)]
            response += float(np.einsum("ij,ik,kj->", left, inner[row], left))
    return max(response, 1e-300)
