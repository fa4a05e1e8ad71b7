"""Errors of models on the same patches of the same pushes, as sums for averages and resampling.

The camera has a fixed pattern of some tenths of a millimetre, which is no error of the simulation.
For each model it is the mean gap in untouched frames, and is subtracted. A model that is also wrong
about the untouched phantom (sag, a moved camera) has its error in that pattern. Therefore the
component of each pattern along the difference of two models' patterns counts as error: a sag of
which two thirds were named leaves one third in the extended model. Nothing is fitted in favour of
either model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.noise.noise_model import patch_variance, scatter_share
from palpate.diagnosis.inference.noise.shared_noise import shared_noise
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import DiagnosisError
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.metrics import paper_distance
from palpate.setup.setup import Setup

__all__ = ["ProbeSums", "fixed_pattern", "paper_sums", "probe_sums", "removed_share"]


@dataclass(frozen=True, eq=False)
class ProbeSums:
    """Sums over all patches of k pushes under m models; each patch counts by its points.

    Attributes:
        names: of the pushes, "sequence/number".
        squares: (k, m) squared errors without the fixed patterns [m^2].
        along: (k, m) each fixed pattern times the difference of two models' patterns [m^2].
        size: (k,) squared difference of the two patterns [m^2].
        floor: (k,) squared error that the scatter of single points leaves [m^2].
        points: (k,) number of points.
    """

    names: tuple[str, ...]
    squares: FloatArray
    along: FloatArray
    size: FloatArray
    floor: FloatArray
    points: FloatArray

    def of(self, rows: Sequence[int]) -> ProbeSums:
        """Return the sums of these pushes alone."""
        own = list(rows)
        arrays = (
            values[own] for values in (self.squares, self.along, self.size, self.floor, self.points)
        )
        return ProbeSums(tuple(self.names[row] for row in own), *arrays)

    def rms(self, chosen: IntArray | None = None, still: bool = True) -> FloatArray:
        """RMS of every model, and the noise floor last, (d, m + 1) [m].

        Args:
            chosen: (d, n) numbers of pushes, drawn with repetition; each push once without it.
            still: whether errors that are also in the untouched phantom count, such as sag.
        """
        rows = np.arange(len(self.names))[None] if chosen is None else chosen
        size, points = self.size[rows].sum(axis=1), np.maximum(self.points[rows].sum(axis=1), 1)
        differ = size > CRITERIA.gain.same_pattern**2 * points
        share = self.along[rows].sum(axis=1) / np.where(differ, size, 1.0)[:, None]
        lasting = np.where(differ & still, size, 0.0)[:, None] * share**2
        mean = (
            np.column_stack(
                [self.squares[rows].sum(axis=1) + lasting, self.floor[rows].sum(axis=1)]
            )
            / points[:, None]
        )
        return np.asarray(np.sqrt(mean))

    def draws(self, seed: int, draws: int = CRITERIA.gain.draws) -> IntArray:
        """Draw numbers of pushes with repetition (draws, k)."""
        return np.random.default_rng(seed).integers(
            0, len(self.names), size=(draws, len(self.names))
        )


def removed_share(baseline: FloatArray, model: FloatArray, floor: FloatArray) -> FloatArray:
    """Share of the reducible error that is removed, at most 1; 0 if the baseline is at the floor.

    Args:
        baseline: RMS of the stated model [m].
        model: RMS of the other model [m].
        floor: RMS of the noise [m].
    """
    reducible = baseline - floor
    some = reducible > CRITERIA.gain.least_reducible
    share = (baseline - model) / np.where(some, reducible, 1.0)
    return np.where(some, np.minimum(share, 1.0), 0.0)


def fixed_pattern(
    item: Observations, model: Prediction, before: bool = False
) -> tuple[FloatArray, FloatArray]:
    """The camera's fixed pattern (p,) [m] in the frames clear of the phantom, and the number of
    points behind it (p,).

    Args:
        item: the sequence.
        model: its prediction.
        before: whether only frames before the first contact count, if there are any; for a phantom
            that keeps a dent or stays where it slid to.
    """
    count = _clear_points(item, model, before)
    total = count.sum(axis=0)
    return (np.nan_to_num(model.gap) * count).sum(axis=0) / np.maximum(total, 1), total


def _clear_points(item: Observations, model: Prediction, before: bool) -> FloatArray:
    """Number of points (g, p) in the frames from which `fixed_pattern` is averaged."""
    free = np.array([group.free for group in item.groups])[:, None]
    early = np.array([group.free and not group.push for group in item.groups])[:, None]
    free = early if before and early.any() else free
    return np.where(free & np.isfinite(model.gap), model.count, 0.0)


def probe_sums(
    data: Sequence[Observations],
    models: Sequence[Sequence[Prediction]],
    lasting: bool = False,
    ends: tuple[int, int] = (0, -1),
) -> ProbeSums:
    """Sum errors over the touched groups of sequences under several models.

    Args:
        data: the sequences.
        models: for each model its predictions, one for each sequence.
        lasting: whether groups after a push count, too, because it leaves a dent or a block that
            slid.
        ends: the two models along whose difference fixed patterns are errors. The second one's
            scatter and points make the noise floor and the weights.

    Raises DiagnosisError if a sequence has no untouched frame, or no sequence has a touched one.
    """
    seen = [row for row in zip(data, *models, strict=True) if not row[0].force_only]
    compared = [row[1:][end] for row in seen for end in ends]
    variance, shared = patch_variance(compared), shared_noise(compared)
    rows: list[tuple[str, FloatArray]] = []
    for item, *own in seen:
        rows += _rows(item, own, (variance, shared), lasting, ends)
    if not rows:
        raise DiagnosisError(
            "the test sequences have no frame in which the tool touches the phantom; "
            "name others in [splits] test"
        )
    names, table, count = (
        np.array([row[0] for row in rows]),
        np.stack([row[1] for row in rows]),
        len(models),
    )
    probes = np.unique(names)
    sums = np.array([table[names == name].sum(axis=0) for name in probes])
    size, floor, points = sums[:, 2 * count :].T
    return ProbeSums(
        tuple(map(str, probes)), sums[:, :count], sums[:, count : 2 * count], size, floor, points
    )


def _rows(
    item: Observations,
    own: Sequence[Prediction],
    noise: tuple[FloatArray, float],
    lasting: bool,
    ends: tuple[int, int],
) -> list[tuple[str, FloatArray]]:
    """Name of the push of each group of one sequence, and the group's sums.

    Args:
        item: the sequence.
        own: its predictions by every model.
        noise: variance of single points by patch (p,) [m^2], and `shared_noise`.
        lasting: as in `probe_sums`.
        ends: as in `probe_sums`.
    """
    variance, shared = noise
    patterns = [fixed_pattern(item, model, lasting) for model in own]
    difference, known = patterns[ends[0]][0] - patterns[ends[1]][0], patterns[ends[1]][1]
    if not known.sum():
        raise DiagnosisError(
            f"{item.name} has no untouched frame, so its noise floor is unknown; "
            "name others in [splits] test"
        )
    alone, clear = scatter_share(own[ends[1]], shared), _clear_points(item, own[ends[1]], lasting)
    pattern_share = (clear**2 * alone).sum(axis=0) / np.maximum(known, 1) ** 2
    rows = []
    for number, group in enumerate(item.groups):
        left = lasting and group.push > 0
        if (group.free and not left) or any(number in model.failed for model in own):
            continue
        seen = np.all([np.isfinite(model.gap[number]) for model in own], axis=0) & (
            known >= CRITERIA.gain.least_points
        )
        count = own[ends[1]].count[number][seen]
        errors = [
            model.gap[number] - pattern for model, (pattern, _) in zip(own, patterns, strict=True)
        ]
        floor = (variance * (alone[number] + pattern_share))[seen] @ count
        products = [
            *(error**2 for error in errors),
            *(pattern * difference for pattern, _ in patterns),
            difference**2,
        ]
        sums = [(values[seen] * count).sum() for values in products]
        rows.append((f"{item.name}/{group.push}", np.array([*sums, floor, count.sum()])))
    return rows


def paper_sums(
    data: Sequence[Observations], predictions: Sequence[Prediction], setup: Setup
) -> dict[str, tuple[float, int]]:
    """Sum of the paper's metric over touched groups [m] and their number, by push
    ("sequence/number").
    """
    surface, sight = setup.surface(), camera_model_for(setup)
    by_push: dict[str, tuple[float, int]] = {}
    for item, prediction in zip(data, predictions, strict=True):
        for number, group in enumerate(item.groups):
            if not item.force_only and not group.free and number not in prediction.failed:
                name = f"{item.name}/{group.push}"
                distance = paper_distance(
                    sight.place(group.points[: CRITERIA.gain.paper_points]),
                    prediction.equilibria[number],
                    surface,
                )
                total, count = by_push.get(name, (0.0, 0))
                by_push[name] = (total + distance, count + 1)
    return by_push
