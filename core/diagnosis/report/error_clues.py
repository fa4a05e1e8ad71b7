"""Clues to an error that no cause explains: when it is left, what it moves with, and what is next.

All figures are of the residual on the fitted sequences beyond noise, with the camera's fixed
pattern taken off, which frames without contact show: all of them, or those before the first push
where it is asked when the error is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.inference.noise.residual_structure import push_sizes
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.diagnosis.search.findings import Findings
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.registration.pose import motion_jacobian

__all__ = ["error_clues"]

CONTACT, RELEASED, BEFORE = "while the tool touches", "after a release", "before the first push"
WHOLE, TOOL, PHANTOM = "the whole view", "the tool", "the phantom's surface"
_NEXT = {
    WHOLE: "check that neither camera nor phantom moves: take a rest cloud between sequences, "
    "and let the table show in every cloud",
    TOOL: "measure the tool's ball and shaft, and touch every landmark twice",
    PHANTOM: "push again at this place, from another side and to another depth",
    BEFORE: "look at the camera, since the error is there before anything is touched: switch its "
    "filters off, or state them in [camera] filters",
    RELEASED: "record ten seconds without the tool after each push",
}
"""What to measure next, by what the error moves with or when it is left."""


@dataclass(frozen=True, eq=False)
class _Residual:
    """The residual of all fitted sequences: n values of one patch in one group each.

    Attributes:
        group: (n,) number of the group, counted through all sequences.
        patch: (n,) number of the patch.
        value: (n,) residual [m].
        sigma: (n,) its standard deviation by noise [m].
        phase: (g,) when each group was taken: one of CONTACT, RELEASED, BEFORE.
        push: (g,) size of the deformation over the sequence's largest [1].
        tool: (g, 3) centre of the tool [m].
        frame: (g,) sequence and time [s] of each group.
    """

    group: IntArray
    patch: IntArray
    value: FloatArray
    sigma: FloatArray
    phase: list[str]
    push: FloatArray
    tool: FloatArray
    frame: list[tuple[str, float]]

    @property
    def whitened(self) -> FloatArray:
        """Residual (n,) over its noise [1]."""
        return np.asarray(self.value / self.sigma)

    def beyond_noise(self, chosen: Any) -> float:
        """RMS of chosen values beyond noise [m]; 0 where noise explains them."""
        if not np.any(chosen):
            return 0.0
        weight = 1 / self.sigma[chosen] ** 2
        excess = np.sum(self.whitened[chosen] ** 2 - 1.0)
        return float(np.sqrt(max(excess, 0.0) / weight.sum()))


def error_clues(
    evaluator: Evaluator, data: Sequence[Observations], findings: Findings, verdict: str
) -> dict[str, Any] | None:
    """Return the clues of an `unexplained` or `ambiguous` verdict, as in the report.

    None for other verdicts, and for sequences without clouds.

    Args:
        evaluator: of the fitted sequences.
        data: their observations.
        findings: of the search.
        verdict: of the report.
    """
    if verdict not in ("unexplained", "ambiguous") or not evaluator.problem.clouds:
        return None
    model = findings.best.model if findings.best else findings.baseline
    when = _when(_residual(evaluator, data, model, early=True))
    left = _residual(evaluator, data, model, early=False)
    moves = _moves_with(evaluator, left)
    strongest = max(moves, key=lambda name: moves[name])
    least = CRITERIA.clues.lasting_share * when[CONTACT]
    before, lasting = when[BEFORE] > least, when[RELEASED] > least
    return {
        "rms_mm_when": when,
        "grows_with_push": _growth(left),
        "moves_with": {name: round(share, 3) for name, share in moves.items()},
        "worst_frames": _worst_frames(left),
        "partial_causes": _partial_causes(findings),
        "measure_next": _NEXT[BEFORE if before else RELEASED if lasting else strongest],
    }


def _residual(
    evaluator: Evaluator, data: Sequence[Observations], model: Model, *, early: bool
) -> _Residual:
    """Collect the residual of a model, without what clear frames show of each patch.

    Args:
        evaluator: with the noise.
        data: the fitted sequences.
        model: whose predictions are compared.
        early: whether only frames before the first push count as clear, where there are two.
    """
    parts: list[tuple[Any, ...]] = []
    phase: list[str] = []
    push: list[FloatArray] = []
    tool: list[FloatArray] = []
    frame: list[tuple[str, float]] = []
    for item, prediction, noise in zip(
        data, model.predictions, evaluator.state.noises, strict=True
    ):
        if prediction.force_only:
            continue
        touched = np.array([one.in_contact for one in prediction.equilibria])
        first = np.array([not one.push for one in item.groups]) & ~touched
        clear = first if early and first.sum() > 1 else ~touched
        group, *values = _without_pattern(prediction, noise, clear)
        parts.append((group + len(phase), *values))
        phase += [_phase(*row) for row in zip(item.groups, touched.tolist(), strict=True)]
        push.append(np.where(touched, push_sizes(prediction), 0.0))
        tool.append(item.centres(model.setup))
        frame += [(item.name, _time(item, one)) for one in item.groups]
    group, patch, value, sigma = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _Residual(
        group.astype(int),
        patch.astype(int),
        value,
        sigma,
        phase,
        np.concatenate(push),
        np.concatenate(tool),
        frame,
    )


def _without_pattern(
    prediction: Prediction, noise: Noise, clear: Any
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Residuals of a sequence without what its groups `clear` (g,) show of each patch on average.

    Returns:
        group (n,), patch (n,), residual (n,) [m], and its standard deviation by noise (n,) [m].
    """
    gap = prediction.gap
    weights = noise.weights[:, : gap.shape[1]]
    seen = np.isfinite(gap) & (weights > 0)
    averaged = np.where(seen & clear[:, None], weights, 0.0)
    total = averaged.sum(axis=0)
    zero = (averaged * np.nan_to_num(gap)).sum(axis=0) / np.maximum(total, 1e-300)
    # A patch that one clear group alone shows has no residual there.
    seen &= (total > 0) & (total > averaged * (1 + 1e-9))
    group, patch = np.nonzero(seen)
    sign = np.where(clear[group], -1.0, 1.0)
    variance = 1 / weights[group, patch] + sign / total[patch]
    value = gap[group, patch] - zero[patch]
    return group, patch, value, np.sqrt(np.maximum(variance, 1e-16))


def _phase(group: Group, touched: bool) -> str:
    return CONTACT if touched else RELEASED if group.push else BEFORE


def _time(item: Observations, group: Group) -> float:
    """Mean time of a group's clouds [s]; NaN for the rest cloud."""
    return float(item.times[list(group.frames)].mean()) if group.frames else np.nan


def _when(left: _Residual) -> dict[str, float]:
    """RMS beyond noise [mm] in contact, after a release and before the first push."""
    phases = np.array(left.phase)[left.group]
    return {
        phase: round(1e3 * left.beyond_noise(phases == phase), 4)
        for phase in (CONTACT, RELEASED, BEFORE)
    }


def _growth(left: _Residual) -> float | None:
    """RMS beyond noise in the deeper half of the frames with contact over that in the other half
    [1]; None where noise explains both.
    """
    depth = left.push[left.group]
    pushed = depth > 0
    middle = float(np.median(depth[pushed])) if pushed.any() else 0.0
    deep, shallow = (left.beyond_noise(pushed & part) for part in (depth > middle, depth <= middle))
    return round(deep / max(shallow, CRITERIA.clues.least_ratio * deep), 2) if deep else None


def _moves_with(evaluator: Evaluator, left: _Residual) -> dict[str, float]:
    """Share [1] of the residual beyond noise, in frames with contact, that moves with the whole
    view, with the tool, and with the phantom's surface.

    Each share is that of a fitted pattern: a rigid motion of each frame; a pattern around the tool
    that grows with the push; a pattern on the surface that does.
    """
    surface, chosen = evaluator.problem.surface, np.array(left.phase)[left.group] == CONTACT
    group, patch = left.group[chosen], left.patch[chosen]
    sigma, whitened, push = left.sigma[chosen], left.whitened[chosen], left.push[group]
    total = float(np.sum(whitened**2 - 1.0))
    if total < CRITERIA.clues.significance * np.sqrt(2 * len(whitened)):
        return {WHOLE: 0.0, TOOL: 0.0, PHANTOM: 0.0}
    centres, normals = surface.patch_centres, surface.patch_normals
    rigid = np.einsum("pi,pij->pj", normals, motion_jacobian(centres, centres.mean(axis=0)))
    removed = 0.0
    for number in np.unique(group):
        own = group == number
        matrix = rigid[patch[own]] / sigma[own, None]
        fitted = matrix @ np.linalg.lstsq(matrix, whitened[own], rcond=None)[0]
        removed += float(fitted @ fitted) - np.linalg.matrix_rank(matrix)
    shares = {WHOLE: removed / total}
    away = centres[patch] - left.tool[group]
    cells = np.unique(
        np.round(away / CRITERIA.clues.tool_cell).astype(int), axis=0, return_inverse=True
    )[1].ravel()
    for name, cell in ((TOOL, cells), (PHANTOM, patch)):
        scaled = push / sigma
        top, bottom = np.bincount(cell, scaled * whitened), np.bincount(cell, scaled**2)
        used = bottom > 0
        shares[name] = float(np.sum(top[used] ** 2 / bottom[used]) - used.sum()) / total
    return {name: float(np.clip(share, 0.0, 1.0)) for name, share in shares.items()}


def _worst_frames(left: _Residual) -> list[dict[str, Any]]:
    """The three frames with the largest residual beyond noise."""
    sizes = [
        left.beyond_noise(left.group == number) if np.isfinite(left.frame[number][1]) else 0.0
        for number in range(len(left.phase))
    ]
    worst = np.argsort(sizes)[::-1][: CRITERIA.clues.worst_frames]
    return [
        {
            "sequence": left.frame[number][0],
            "time_s": round(left.frame[number][1], 3),
            "rms_mm": round(1e3 * sizes[number], 4),
        }
        for number in worst.tolist()
        if sizes[number] > 0
    ]


def _partial_causes(findings: Findings) -> list[dict[str, Any]]:
    """The best sets of causes that were fitted, and the share of the error that each leaves."""
    rows = []
    for trial in sorted(findings.trials, key=lambda one: -one.gain)[
        : CRITERIA.clues.partial_causes
    ]:
        left = findings.share_left(trial.misfit)
        rows.append(
            {
                "effects": list(trial.model.names),
                "gain_nats": round(trial.gain, 2),
                "left": round(left, 4),
            }
        )
    return rows
