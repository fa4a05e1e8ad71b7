"""The gain: what naming the cause is worth on sequences that nothing was fitted on.

The camera has a fixed pattern of some tenths of a millimetre, which is no error of the simulation. In each model it is what the
untouched frames show, and it is taken off there. But a model that is wrong about the untouched block, too (sag, a camera that was
moved), has its error in that very pattern. What both patterns hold along their own difference is given back to each: a sag of which
two thirds were named leaves one third in the extended model. Nothing here is fitted in favour of one of the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.diagnosis.force import rms_force
from core.diagnosis.noise import patch_variance
from core.diagnosis.observations import Observations
from core.diagnosis.prediction import Prediction
from core.errors import DiagnosisError
from core.frames import FloatArray
from core.measurement import Surface
from core.metrics import paper_distance
from core.setup import Setup
from core.sight import sight_of

__all__ = ["Ladder", "fixed_pattern", "ladder"]

_DRAWS = 2000
_PAPER_POINTS = 4000
_LEAST_POINTS = 5
_SAME_PATTERN = 1e-5
"""Patterns that differ by less than this [m] are one: the models agree about the untouched block."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Ladder:
    """RMS of patch averages of signed distance [m] in touched frames, and the share of the reducible error that is removed.

    Attributes:
        baseline, extended: of the stated and the extended model. noise_floor: what the scatter of single points leaves.
        removed: (value, low, high) of (baseline - extended) / (baseline - noise floor); 95 % interval from resampled probes.
        paper: the paper's metric (baseline, extended) [m]. probes: how many pushes of the tool were resampled.
        force: RMS of measured minus simulated force (baseline, extended, noise floor) [N]; None where none was measured.
        tuned: as `removed`, of the stated model with what is known only to its accuracy as fitted, and no cause; None if not asked.
    """

    baseline: float
    extended: float
    noise_floor: float
    removed: tuple[float, float, float]
    paper: tuple[float, float]
    probes: int
    force: tuple[float, float, float] | None = None
    tuned: tuple[float, float, float] | None = None


def fixed_pattern(item: Observations, model: Prediction, before: bool = False) -> tuple[FloatArray, FloatArray]:
    """The camera's fixed pattern (p,) [m] in the frames clear of the block, and how many points it rests on (p,).

    Of a block that may keep a dent only those `before` the first touch count, if there are any.
    """
    free = np.array([group.free for group in item.groups])[:, None]
    early = np.array([group.free and not group.probe for group in item.groups])[:, None]
    free = early if before and early.any() else free
    count = np.where(free & np.isfinite(model.gap), model.count, 0.0)
    total = count.sum(axis=0)
    return (np.nan_to_num(model.gap) * count).sum(axis=0) / np.maximum(total, 1), total


def _share(baseline: FloatArray, extended: FloatArray, floor: FloatArray) -> FloatArray:
    """Removed share, at most all; nothing is reducible where the baseline already lies at the floor."""
    reducible = baseline - floor
    share = (baseline - extended) / np.where(reducible > 1e-6, reducible, 1.0)
    return np.where(reducible > 1e-6, np.minimum(share, 1.0), 0.0)


def ladder(
    data: Sequence[Observations],
    baseline: Sequence[Prediction],
    extended: Sequence[Prediction],
    stated: Setup,
    found: Setup,
    seed: int,
) -> Ladder:
    """Compare two models on test sequences; probes are resampled whole.

    Groups in touch count, and of a material that remembers also what a push has left.
    """
    lasting = found.material.remembers
    seen_by_camera = [row for row in zip(data, baseline, extended, strict=True) if not row[0].unseen]
    variance, rows = patch_variance([model for row in seen_by_camera for model in row[1:]]), []
    for item, before, after in seen_by_camera:
        (own, _), (other, known) = fixed_pattern(item, before, lasting), fixed_pattern(item, after, lasting)
        difference = own - other
        if not known.sum():
            raise DiagnosisError(f"{item.name} has no untouched frame, so its noise floor is unknown; name others in [splits] test")
        for number, group in enumerate(item.groups):
            left = lasting and group.probe > 0
            if (group.free and not left) or number in before.failed or number in after.failed:
                continue
            seen = np.isfinite(before.gap[number]) & np.isfinite(after.gap[number]) & (known >= _LEAST_POINTS)
            count = after.count[number][seen]
            errors = [before.gap[number] - own, after.gap[number] - other]
            floor = (variance[seen] * (1 + count / known[seen])).sum()
            products = [*(error**2 for error in errors), own * difference, difference**2]
            sums = [(values[seen] * count).sum() for values in products]
            rows.append((f"{item.name}/{group.probe}", *sums, floor, count.sum()))
    if not rows:
        raise DiagnosisError("the test sequences have no frame in which the tool touches the phantom; name others in [splits] test")
    table = np.array([row[1:] for row in rows])
    names = np.array([row[0] for row in rows])
    probes = np.array([table[names == name].sum(axis=0) for name in np.unique(names)])
    chosen = np.random.default_rng(seed).integers(0, len(probes), size=(_DRAWS, len(probes)))
    drawn, whole = _rms(probes[chosen].sum(axis=1)), _rms(probes.sum(axis=0)[None])
    low, high = np.quantile(_share(*drawn), [0.025, 0.975])
    return Ladder(
        baseline=float(whole[0][0]), extended=float(whole[1][0]), noise_floor=float(whole[2][0]),
        removed=(float(_share(*whole)[0]), float(low), float(high)),
        paper=(_paper(data, baseline, stated), _paper(data, extended, found)), probes=len(probes),
        force=_force(baseline, extended),
    )  # fmt: skip


def _force(baseline: Sequence[Prediction], extended: Sequence[Prediction]) -> tuple[float, float, float] | None:
    """RMS force error (baseline, extended, noise floor) [N] in groups in which the tool of either model presses."""
    before, after = [], []
    for one, other in zip(baseline, extended, strict=True):
        if one.felt is not None and other.felt is not None:
            touched = [a.in_contact or b.in_contact for a, b in zip(one.equilibria, other.equilibria, strict=True)]
            before.append((one.felt, np.array(touched)))
            after.append((other.felt, np.array(touched)))
    if not before:
        return None
    raw, floor = rms_force(before)
    return raw, rms_force(after)[0], floor


def _rms(sums: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """RMS of baseline, extended model and noise floor (d,) [m] from sums (d, 6): squared errors of both, the stated model's pattern
    times the patterns' difference, that difference squared, floor, points."""
    along, size, points = sums[:, 2], sums[:, 3], np.maximum(sums[:, 5], 1)
    differ = size > _SAME_PATTERN**2 * points
    share = along / np.where(differ, size, 1.0)
    still = np.where(differ, size, 0.0)[:, None] * np.stack([share, share - 1], axis=1) ** 2
    mean = np.column_stack([sums[:, :2] + still, sums[:, 4]]) / points[:, None]
    before, after, floor = np.sqrt(mean).T
    return before, after, floor


def _paper(data: Sequence[Observations], predictions: Sequence[Prediction], setup: Setup) -> float:
    """The paper's metric [m], mean over touched groups."""
    surface, sight, found = Surface.of(setup), sight_of(setup), []
    for item, prediction in zip(data, predictions, strict=True):
        for number, group in enumerate(item.groups):
            if not item.unseen and not group.free and number not in prediction.failed:
                found.append(paper_distance(sight.place(group.points[:_PAPER_POINTS]), prediction.equilibria[number], surface))
    return float(np.mean(found)) if found else float("nan")
