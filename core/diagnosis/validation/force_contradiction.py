"""Forces that a model does not explain better than a constant does.

Such forces do not come from these pushes as recorded: a sensor that was off, another clock, another
sign or frame. A cause, or an all-clear, that rests on them is not sure.
"""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.observation.force_record import ForceComparison
from palpate.foundation.arrays import FloatArray

__all__ = ["constant_share", "force_contradiction"]


def force_contradiction(baseline: Model, model: Model) -> str:
    """Return why the fitted sequences' forces contradict a model; empty where they do not.

    The model's forces may be scaled by any positive number, since Young's modulus is free.

    Args:
        baseline: the stated setup, whose forces say whether pushes can be felt.
        model: that a verdict rests on.
    """
    stated, found = _forces(baseline), _forces(model)
    measured, predicted, noise = found
    if len(measured) < CRITERIA.rejection.least_forces:
        return ""
    felt = np.sqrt((stated[1] ** 2).sum(axis=1).mean())
    if felt < CRITERIA.rejection.felt * np.sqrt(3 * (noise**2).mean()):
        return ""
    share = constant_share(measured, predicted)
    if share < 1.0:
        return ""
    names = " and ".join(model.names) or "the stated setup"
    return (
        f"the forces contradict the pushes: scaled as well as it can be, {names} leaves "
        f"{share:.2f} times the variance of the measured forces that one constant force leaves "
        "(less than 1 is expected), so that nothing is sure; check forces.csv with palpate check: "
        "sign, frame, unit and clock"
    )


def constant_share(measured: FloatArray, predicted: FloatArray) -> float:
    """Squared error that predicted forces (n, 3) [N], scaled by the best positive number, leave of
    measured ones, over the squared error that a constant leaves [1].
    """
    square = float((predicted**2).sum())
    scale = max(float((measured * predicted).sum()) / square, 0.0) if square > 0 else 0.0
    left = float(((measured - scale * predicted) ** 2).sum())
    constant = float(((measured - measured.mean(axis=0)) ** 2).sum())
    if constant == 0.0:
        return np.inf
    return left / constant


def _forces(model: Model) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measured and predicted forces (n, 3) and noise (n,) [N] of all groups with both."""
    parts = [(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))]
    for one in model.predictions:
        if one.forces is None:
            continue
        parts.append(_known(one.forces, one.failed))
    measured, predicted, noise = (np.concatenate(part) for part in zip(*parts, strict=True))
    return measured, predicted, noise


def _known(
    forces: ForceComparison, failed: tuple[int, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    known = np.asarray(np.isfinite(forces.gap + forces.force).all(axis=1))
    known[list(failed)] = False
    return (forces.gap + forces.force)[known], forces.force[known], forces.noise[known]
