"""The report of a palpation without clouds: each push, Young's modulus, and an inclusion's
footprint, depth and cover.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.observation.force_only import deepest_rows
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.report.inclusion_footprint import Footprint, depth_of, footprint_of
from palpate.diagnosis.search.findings import Findings
from palpate.effects import NuisanceBlock
from palpate.effects.base import with_effects
from palpate.foundation.arrays import FloatArray

__all__ = ["PushForces", "push_forces", "with_palpation"]


@dataclass(frozen=True, eq=False)
class PushForces:
    """Forces of the k fitted pushes, each at its full depth.

    Attributes:
        place: (k, 3) on the stated surface [m].
        normal: (k, 3) outwards.
        depth: (k,) [m].
        measured: (k,) force along the normal [N].
        stated: (k,) the same of the stated model; NaN without an equilibrium.
        extended: (k,) the same of the extended model; NaN without an equilibrium.
    """

    place: FloatArray
    normal: FloatArray
    depth: FloatArray
    measured: FloatArray
    stated: FloatArray
    extended: FloatArray

    def to_json(self) -> list[dict[str, Any]]:
        """Rows of the report, in SI units."""
        return [
            {
                "place": np.round(place, 5).tolist(),
                "depth": round(float(depth), 5),
                **{
                    name: _number(value)
                    for name, value in zip(("measured", "stated", "extended"), forces, strict=True)
                },
            }
            for place, depth, *forces in zip(
                self.place, self.depth, self.measured, self.stated, self.extended, strict=True
            )
        ]


def push_forces(
    evaluator: Evaluator, data: Sequence[Observations], baseline: Model, extended_model: Model
) -> PushForces:
    """Collect the pushes of all sequences without clouds, in their order."""
    rows: list[tuple[float, ...]] = []
    place, normal = evaluator.problem.pushes
    for item, before, after in zip(
        data, baseline.predictions, extended_model.predictions, strict=True
    ):
        if not item.force_only or before.forces is None or after.forces is None:
            continue
        centres = item.centres(evaluator.problem.setup)
        for row in deepest_rows(item):
            out = normal[len(rows)]
            depth = evaluator.problem.setup.tool.radius - float(
                evaluator.problem.setup.geometry.facing(centres[row][None])[0][0]
            )
            stated, extended = (
                side.forces.force[row] @ out for side in (before, after) if side.forces is not None
            )
            lost = [number for number, side in enumerate((before, after)) if row in side.failed]
            forces = [float(value) for value in (stated, extended)]
            for number in lost:
                forces[number] = float("nan")
            rows.append(
                (depth, float((before.forces.gap[row] + before.forces.force[row]) @ out), *forces)
            )
    depths, measured, stated_all, extended_all = np.array(rows).reshape(-1, 4).T
    return PushForces(place, normal, depths, measured, stated_all, extended_all)


def with_palpation(
    report: dict[str, Any], evaluator: Evaluator, data: Sequence[Observations], findings: Findings
) -> tuple[dict[str, Any], PushForces, Footprint | None]:
    """Add `palpation` to a report, and `footprint`, `depth` and `cover` to an inclusion among its
    causes.

    Returns the report, and the pushes and the footprint for the figure.
    """
    model = findings.best.model if findings.best else findings.baseline
    pushes = push_forces(evaluator, data, findings.baseline, model)
    causes, shown = list(report["causes"]), None
    for index, effect in enumerate(model.effects):
        if effect.lump(evaluator.problem.setup) is None:
            continue
        evaluator.report("where the lump is felt")
        shown = footprint_of(
            evaluator, effect, _without(evaluator, model, index), float(np.median(pushes.depth))
        )
        depth, cover = depth_of(evaluator, model, index)
        added = {
            "depth": depth,
            "cover": cover,
            "footprint": None if shown is None else shown.to_json(),
        }
        causes = [cause | added if cause["effect"] == effect.name else cause for cause in causes]
    palpation = {
        "pushes": len(pushes.depth),
        "depth": {"value": round(float(np.median(pushes.depth)), 5), "unit": "m"},
        "force": {"value": round(float(np.median(pushes.measured)), 5), "unit": "N"},
        "young_modulus": _modulus(evaluator, report),
        "weighed": [kind.name for kind in evaluator.problem.applicable],
        "felt": pushes.to_json(),
    }
    return {**report, "causes": causes, "palpation": palpation}, pushes, shown


def _without(evaluator: Evaluator, model: Model, index: int) -> Any:
    others = [effect for number, effect in enumerate(model.effects) if number != index]
    return with_effects(evaluator.problem.setup, others)


def _modulus(evaluator: Evaluator, report: dict[str, Any]) -> dict[str, Any] | None:
    """Young's modulus with its interval, as a cause or as identified; None if it is neither."""
    for kind in evaluator.problem.effects_sharing(NuisanceBlock.YOUNG_MODULUS):
        for row in (*report["causes"], *report["identified"]):
            if row["effect"] == kind.name:
                entry: dict[str, Any] = row["parameters"][kind.numbers()[0].name]
                return entry
    return None


def _number(value: float) -> float | None:
    return round(value, 5) if np.isfinite(value) else None
