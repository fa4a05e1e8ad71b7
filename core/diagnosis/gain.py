"""The gain: what naming the cause is worth on sequences that nothing was fitted on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.diagnosis.observations import Observations
from core.diagnosis.prediction import Prediction
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
        baseline, extended: of the stated and the extended model. noise_floor: of the extended model in untouched frames.
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
    """Sum of squared gaps [m^2] and number of points of each group."""
    count = np.where(np.isfinite(prediction.gap), prediction.count, 0.0)
    within = np.where(count > 0, prediction.spread**2 * np.maximum(count - 1, 0), 0.0)
    total = np.nan_to_num(prediction.gap) ** 2 * count + np.nan_to_num(within)
    return total.sum(axis=1), count.sum(axis=1)


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
    rows, free = [], []
    for item, before, after in zip(data, baseline, extended, strict=True):
        (square_0, count_0), (square_1, count_1) = _squares(before), _squares(after)
        for number, group in enumerate(item.groups):
            entry = (square_0[number], count_0[number], square_1[number], count_1[number])
            if group.free and not group.reference:
                free.append(entry)
            elif not group.free and number not in before.failed and number not in after.failed:
                rows.append((f"{item.name}/{group.probe}", *entry))
    names = np.array([row[0] for row in rows])
    values = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 4)
    probes = np.array([values[names == name].sum(axis=0) for name in np.unique(names)]).reshape(-1, 4)
    untouched = np.array(free, dtype=float).reshape(-1, 4)
    floor = float(np.sqrt(untouched[:, 2].sum() / max(untouched[:, 3].sum(), 1)))
    chosen = np.random.default_rng(seed).integers(0, len(probes), size=(_DRAWS, len(probes)))
    drawn = probes[chosen].sum(axis=1)
    whole = probes.sum(axis=0)
    rms = [float(np.sqrt(whole[i] / max(whole[i + 1], 1))) for i in (0, 2)]
    shares = _share(np.sqrt(drawn[:, 0] / drawn[:, 1]), np.sqrt(drawn[:, 2] / drawn[:, 3]), np.full(_DRAWS, floor))
    share = float(_share(np.array(rms[0]), np.array(rms[1]), np.array(floor)))
    low, high = np.quantile(shares, [0.025, 0.975])
    return Ladder(
        baseline=rms[0], extended=rms[1], noise_floor=floor, removed=(share, float(low), float(high)),
        paper=(_paper(data, baseline, stated), _paper(data, extended, found)), probes=len(probes),
    )  # fmt: skip


def _paper(data: Sequence[Observations], predictions: Sequence[Prediction], setup: Setup) -> float:
    """The paper's metric [m], mean over touched groups."""
    surface, pose, found = Surface(setup.geometry), setup.phantom_from_camera_true, []
    for item, prediction in zip(data, predictions, strict=True):
        for number, group in enumerate(item.groups):
            if not group.free and number not in prediction.failed:
                found.append(paper_distance(pose.apply(group.points[:_PAPER_POINTS]), prediction.equilibria[number], surface))
    return float(np.mean(found)) if found else float("nan")
