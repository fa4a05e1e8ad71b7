"""Young's modulus as the measured forces identify it, for the report."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.credible_intervals import modulus_interval
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.search.findings import Findings
from palpate.effects import NuisanceBlock
from palpate.effects.base import Slot
from palpate.foundation.arrays import FloatArray
from palpate.foundation.quantities import quantity
from palpate.setup.setup import Setup

__all__ = ["modulus_entries"]


def modulus_entries(
    evaluator: Evaluator, findings: Findings, named: set[str]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the report's entries of Young's modulus where it is no cause.

    Args:
        evaluator: of the problem.
        findings: of the search.
        named: effects of the causes.

    Returns:
        entries of `identified` and of `not_identifiable`, of which one is empty.
    """
    kinds = evaluator.problem.effects_sharing(NuisanceBlock.YOUNG_MODULUS)
    if not kinds or any(kind.name in named for kind in kinds):
        return [], []
    name = kinds[0].name
    if findings.contradicted:
        why = "the measured forces contradict the pushes, so that they fix no modulus"
        again = "the force on the tool again, after palpate check is clear"
        return [], [_unknown(name, why, again)]
    model = findings.best.model if findings.best else findings.baseline
    interval = modulus_interval(evaluator, model)
    height = ""
    if interval is not None and (spread := _spread_by_height(evaluator, model)):
        interval = _widened(interval, spread)
        sigma = quantity(evaluator.problem.height_sigma or 0.0, "m")
        height = f"; the height is stated to {sigma}, which is part of it"
    if interval is None:
        why = (
            "the tool is driven by position and no force was measured: "
            "a phantom of any stiffness takes the same shape"
        )
        return [], [
            _unknown(
                name,
                why,
                "the force on the tool (forces.csv), or a drop of known weight on the phantom",
            )
        ]
    value, low, high = interval
    if high > CRITERIA.verdict.most_modulus_ratio * value:
        why = (
            f"the measured forces leave anything between {low:.3g} and {high:.3g} Pa open: "
            "they hardly stand out of their noise"
        )
        return [], [_unknown(name, why, "deeper pushes, or with a sensor of less noise")]
    stated = evaluator.problem.setup.material.young_modulus
    why = (
        f"the measured forces fix it within {100 * (high / value - 1):.0f} %; "
        f"{stated:.4g} Pa were stated{height}"
    )
    parameters = {"E": {"value": value, "unit": "Pa", "low": low, "high": high}}
    return [{"effect": name, "why": why, "stated": stated, "parameters": parameters}], []


def _unknown(name: str, why: str, instead: str) -> dict[str, str]:
    """Entry of `not_identifiable` for Young's modulus."""
    return {"effect": name, "why": why, "measure_instead": instead}


def _spread_by_height(evaluator: Evaluator, model: Model) -> float:
    """Deviation of the modulus' logarithm [1] that the stated accuracy of the height leaves.

    A softer body and a higher one feel alike, and a force is linear in the modulus: the deviation
    is the change of the forces when the body is higher by one standard deviation. It is zero where
    no accuracy is stated, or where a cause states the geometry.
    """
    problem = evaluator.problem
    fitted = any(effect.enters is Slot.GEOMETRY for effect in model.effects)
    if problem.height_sigma is None or fitted:
        return 0.0
    evaluator.report("how far the height's accuracy leaves the modulus open")
    begun = [
        evaluator.workers.submit(
            [one.name],
            _higher(model.setup, problem.height_sigma, _level(one)),
            problem.grid,
            None,
            [one],
            CRITERIA.replay.tolerance,
        )[0]
        for one in model.predictions
    ]
    before = np.concatenate([_forces(one) for one in model.predictions])
    after = np.concatenate([_forces(one) for one in evaluator.finished(begun)])
    return abs(float(np.log((before * after).sum() / (before**2).sum())))


def _forces(prediction: Prediction) -> FloatArray:
    """Forces on the tool (g, 3) [N] in the equilibria of a prediction."""
    return np.array([frame.force for frame in prediction.equilibria])


def _level(prediction: Prediction) -> float:
    """Mean height of the tool's centre in contact [m], about that of the touched surface."""
    heights = [frame.tool.centre[2] for frame in prediction.equilibria if frame.in_contact]
    return float(np.mean(heights)) if heights else np.inf


def _higher(setup: Setup, rise: float, level: float) -> Setup:
    """The setup with a body that is higher, and with the tool raised as its surface is there.

    The surface is where the registrations saw it; what holds the body is further below.

    Args:
        setup: of the model.
        rise: of the highest point [m].
        level: height of the surface that is touched [m].
    """
    height = setup.geometry.height
    x, y, z = setup.tool.offset
    return replace(
        setup,
        geometry=setup.geometry.scaled(np.array([1.0, 1.0, 1.0 + rise / height])),
        tool=replace(setup.tool, offset=(x, y, z + rise * min(1.0, level / height))),
    )


def _widened(interval: tuple[float, float, float], spread: float) -> tuple[float, float, float]:
    """An interval of the modulus with a further deviation of its logarithm [1], in quadrature."""
    value, low, high = interval
    further = CRITERIA.intervals.normal_quantile * spread
    below, above = np.hypot(np.log([value / low, high / value]), further)
    return value, float(value * np.exp(-below)), float(value * np.exp(above))
