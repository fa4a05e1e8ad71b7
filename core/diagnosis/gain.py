"""The gain: what naming the cause is worth on sequences that nothing was fitted on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.diagnosis.observations import Observations
from core.diagnosis.prediction import Prediction
from core.errors import DiagnosisError
from core.frames import FloatArray
from core.measurement import Surface
from core.metrics import paper_distance
from core.setup import Setup

__all__ = ["Ladder", "ladder"]

_DRAWS = 2000
_PAPER_POINTS = 4000


@dataclass(frozen=True, eq=False, kw_only=True)
class Ladder:
    """RMS of signed distance [m] in touched frames, and the share of the reducible error that is removed.

    Attributes:
        baseline, extended: of the stated and the extended model.
        noise_floor: of the extended model in untouched frames, in the same patches.
        removed: (value, low, high) of (baseline - extended) / (baseline - noise floor); 95 % interval from resampled probes.
        paper: the paper's metric (baseline, extended) [m]. probes: how many pushes of the tool were resampled.
    """

    baseline: float
    extended: float
    noise_floor: float
    removed: tuple[float, float, float]
    paper: tuple[float, float]
    probes: int


def _squares(prediction: Prediction) -> tuple[FloatArray, FloatArray]:
    """Sum of squared gaps (g, p) [m^2] and number of points (g, p)."""
    count = np.where(np.isfinite(prediction.gap), prediction.count, 0.0)
    within = np.where(count > 0, prediction.spread**2 * np.maximum(count - 1, 0), 0.0)
    return np.asarray(np.nan_to_num(prediction.gap) ** 2 * count + np.nan_to_num(within)), count


def _share(baseline: FloatArray, extended: FloatArray, floor: FloatArray) -> FloatArray:
    """Removed share; nothing is reducible where the baseline already lies at the floor."""
    reducible = baseline - floor
    return np.where(reducible > 1e-6, (baseline - extended) / np.where(reducible > 1e-6, reducible, 1.0), 0.0)


def ladder(
    data: Sequence[Observations],
    baseline: Sequence[Prediction],
    extended: Sequence[Prediction],
    stated: Setup,
    found: Setup,
    seed: int,
) -> Ladder:
    """Compare two models on test sequences, groups in touch only; probes are resampled whole."""
    rows, quiet, seen = [], 0.0, 0.0
    for item, before, after in zip(data, baseline, extended, strict=True):
        (square_0, count_0), (square_1, count_1) = _squares(before), _squares(after)
        for number, group in enumerate(item.groups):
            if group.free and not group.reference:
                quiet, seen = quiet + square_1[number], seen + count_1[number]
            elif not group.free and number not in before.failed and number not in after.failed:
                rows.append((f"{item.name}/{group.probe}", square_0[number], count_0[number], square_1[number], count_1[number]))
    if not rows:
        raise DiagnosisError("the test sequences have no frame in which the tool touches the phantom; name others in [splits] test")
    if not np.sum(seen):
        raise DiagnosisError(
            "the test sequences have no untouched frame, so their noise floor is unknown; name others in [splits] test"
        )
    # Each patch has its own noise (slant, distance, bias): the floor is that of the patches seen while touched.
    level = np.where(seen > 0, quiet / np.maximum(seen, 1), np.sum(quiet) / np.sum(seen))
    sums = np.array([[before.sum(), n_0.sum(), after.sum(), n_1.sum(), (level * n_1).sum()] for _, before, n_0, after, n_1 in rows])
    names = np.array([row[0] for row in rows])
    probes = np.array([sums[names == name].sum(axis=0) for name in np.unique(names)])
    chosen = np.random.default_rng(seed).integers(0, len(probes), size=(_DRAWS, len(probes)))
    drawn, whole = _rms(probes[chosen].sum(axis=1)), _rms(probes.sum(axis=0)[None])
    low, high = np.quantile(_share(*drawn), [0.025, 0.975])
    return Ladder(
        baseline=float(whole[0][0]), extended=float(whole[1][0]), noise_floor=float(whole[2][0]),
        removed=(float(_share(*whole)[0]), float(low), float(high)),
        paper=(_paper(data, baseline, stated), _paper(data, extended, found)), probes=len(probes),
    )  # fmt: skip


def _rms(sums: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """RMS of baseline, extended model and noise floor (d,) [m] from sums (d, 5)."""
    before, after = np.maximum(sums[:, 1], 1), np.maximum(sums[:, 3], 1)
    return np.sqrt(sums[:, 0] / before), np.sqrt(sums[:, 2] / after), np.sqrt(sums[:, 4] / after)


def _paper(data: Sequence[Observations], predictions: Sequence[Prediction], setup: Setup) -> float:
    """The paper's metric [m], mean over touched groups."""
    surface, pose, found = Surface(setup.geometry), setup.phantom_from_camera_true, []
    for item, prediction in zip(data, predictions, strict=True):
        for number, group in enumerate(item.groups):
            if not group.free and number not in prediction.failed:
                found.append(paper_distance(pose.apply(group.points[:_PAPER_POINTS]), prediction.equilibria[number], surface))
    return float(np.mean(found)) if found else float("nan")
