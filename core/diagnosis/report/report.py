"""From findings to the report: verdict, causes with intervals, ranking, what this data cannot tell,
and what is left.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.dataset import Dataset
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.gain.force_gain import ForceGain
from palpate.diagnosis.gain.gain_ladder import SurfaceGain
from palpate.diagnosis.inference.credible_intervals import intervals, modulus_interval
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.mesh_discrepancy import too_coarse
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.model_probabilities import probabilities
from palpate.diagnosis.validation.worst_location import worst_patch_location, worst_push_location
from palpate.effects.elastic_material import YoungModulus
from palpate.effects.geometry import MeshResolution

__all__ = ["report_of", "verdict_of"]


_NOT_FITTED = ", on which nothing was fitted"


def verdict_of(findings: Findings) -> str:
    """One of found, none, ambiguous, unexplained."""
    if findings.best is None:
        return (
            "unexplained"
            if findings.structured or findings.misfit > CRITERIA.verdict.unexplained_misfit
            else "none"
        )
    if findings.rivals():
        return "ambiguous"
    return "found"


def _probabilities(findings: Findings) -> dict[tuple[str, ...], float]:
    """Of the sets of causes that were tried, each by the fit that gains most, and of none."""
    surplus: dict[tuple[str, ...], float] = {}
    for trial in findings.trials:
        surplus[trial.model.names] = max(
            trial.gain - trial.asked, surplus.get(trial.model.names, -np.inf)
        )
    return probabilities(surplus)


def _removed(findings: Findings, misfit: float) -> float:
    """Share of the misfit above noise that a model removes on the sequences it was fitted on."""
    return float(np.clip((findings.misfit - misfit) / max(findings.misfit - 1.0, 1e-9), 0.0, 1.0))


def _causes(bench: Bench, findings: Findings, trials: list[Trial]) -> list[dict[str, Any]]:
    chances = _probabilities(findings)
    found: list[dict[str, Any]] = []
    for trial in trials:
        for effect, entry in zip(trial.model.effects, intervals(bench, trial.model), strict=True):
            if any(row["effect"] == effect.name for row in found):
                continue  # rival pairs share a cause
            chance = sum(p for names, p in chances.items() if effect.name in names)
            found.append(
                {"effect": effect.name, "probability": round(chance, 4), "parameters": entry}
            )
    return found


def _ranking(bench: Bench, findings: Findings, named: set[str]) -> list[dict[str, Any]]:
    chances = _probabilities(findings)
    rows = []
    for kind in bench.weighed:
        if kind.name in named:
            continue
        alone = [t for t in findings.trials if t.model.names == (kind.name,)]
        row: dict[str, Any] = {
            "effect": kind.name,
            "probability": round(sum(p for names, p in chances.items() if kind.name in names), 4),
            "error_removed": round(
                max((_removed(findings, t.misfit) for t in alone), default=0.0), 4
            ),
            "gain_nats": round(
                max([t.gain for t in alone] or [findings.screened.get(kind.name, 0.0)]), 2
            ),
            "refitted": bool(alone),
        }
        rows.append(row)
    return sorted(rows, key=lambda row: -row["gain_nats"])


def _model(trial: Trial) -> dict[str, Any]:
    """A set of causes that was fitted, and which data speak for it."""
    blocks = [*(block.name for block in trial.model.blocks), "stated accuracies"]
    parts = [
        {"of": name, "gain_nats": round(part, 2)}
        for name, part in zip(blocks, trial.parts, strict=bool(trial.parts))
    ]
    effects = [effect.to_json() for effect in trial.model.effects]
    asked = (
        round(trial.asked, 2) if np.isfinite(trial.asked) else None
    )  # refused, although it gains what was asked
    gain, misfit = round(trial.gain, 2), round(trial.misfit, 4)
    return {
        "effects": effects,
        "gain_nats": gain,
        "asked_nats": asked,
        "misfit": misfit,
        "parts": parts,
    }


def _unexplained(bench: Bench, findings: Findings) -> dict[str, Any]:
    """How much of the structured error is left, over what chance gives, and where and when it
    sits."""
    model = findings.best.model if findings.best else findings.baseline
    before, left, note = findings.structure, findings.left, ""
    if findings.missed and findings.beyond is not None:
        model, before, left = (
            findings.beyond.model,
            findings.beyond.structure,
            findings.beyond.structure,
        )
        note = _NOT_FITTED
    worst = {
        block.name: block.gram[0, 0] / max(block.values, 1)
        for block in model.blocks
        if block.name != "rest"
    }
    when = max(worst, key=lambda name: worst[name])
    fraction = (
        max(left.ratio - 1.0, 0.0) / max(before.ratio, left.ratio, 1.0) if left.significant else 0.0
    )
    if (one := findings.unusual) is not None and not left.significant:
        note = note if one is findings.asked else _NOT_FITTED
        when, fraction, place = one.sequence, one.share, one.place
    else:
        place = (
            worst_patch_location(model.predictions, bench)
            if bench.seen
            else worst_push_location(model.predictions, bench)
        )
    where = str(place)
    when = f"most in {when}{note}"
    if findings.ripple.significant and not left.significant:
        fraction = findings.ripple.share
        where, when = (
            "all over rest.ply, alike at equal distances from the camera",
            "always, also while nothing is touched",
        )
    return {
        "fraction": round(fraction, 4),
        "where": where,
        "when": when,
        "misfit_per_value": round(bench.misfit(model), 4),
        "structure": round(left.ratio, 4),
        "structure_bound": round(left.bound / left.expected, 4),
    }


def _all_clear(findings: Findings) -> dict[str, Any]:
    """What an all-clear was checked against; nothing where none was given."""
    found: dict[str, Any] = {}
    if findings.beyond is not None:
        beyond = findings.beyond.structure
        found["held_out_structure"] = round(beyond.ratio, 4)
        found["held_out_structure_bound"] = round(beyond.bound / beyond.expected, 4)
    if findings.looked_at:
        found["local_stiffness_error"] = [one.to_json() for one in findings.looked_at]
    return found


def report_of(
    dataset: Dataset,
    bench: Bench,
    findings: Findings,
    gain: SurfaceGain | ForceGain | None,
    split: str,
) -> dict[str, Any]:
    """The report contract."""
    verdict = verdict_of(findings)
    best = [findings.best] if findings.best else []
    trials = [*best, *findings.rivals()] if verdict == "ambiguous" else best
    causes = _causes(bench, findings, trials)
    named = {cause["effect"] for cause in causes}
    known, unknown = _modulus(bench, findings, named)
    coarse = (
        ""
        if bench.on_own_grid
        else too_coarse(findings.screened.get(MeshResolution.name, 0.0), findings.bound)
    )
    told = (
        findings.withdrawn,
        coarse,
        findings.ripple.warning,
        findings.unusual.warning if findings.unusual else "",
    )
    report: dict[str, Any] = {
        "format": 1,
        "dataset": dataset.name,
        "verdict": verdict,
        "causes": causes,
        "interval_level": CRITERIA.intervals.level,
        "ranking": _ranking(bench, findings, named),
        "models": [_model(trial) for trial in findings.trials],
        "identified": known,
        "not_identifiable": unknown,
        "unexplained": _unexplained(bench, findings),
        "gain": None,
        "ambiguity_map": [one.to_json() for one in findings.told],
        "evidence": {
            "gain_nats": round(findings.best.gain, 2) if findings.best else 0.0,
            "bound_nats": round(findings.bound, 2),
            "baseline_misfit": round(findings.misfit, 4),
            "structure": round(findings.structure.ratio, 4),
            "structure_bound": round(findings.structure.bound / findings.structure.expected, 4),
            "evaluations": bench.evaluations,
            "fitted_on": list(bench.names),
            **_all_clear(findings),
        },
        "warnings": [*bench.registration.warnings, *(text for text in told if text)],
    }
    if isinstance(gain, ForceGain):
        report["gain"] = gain.to_json(split)
    elif gain is not None:
        value, low, high = gain.removed
        report["gain"] = {
            "split": split,
            "unit": "mm",
            "baseline": round(gain.baseline * 1e3, 4),
            "extended": round(gain.extended * 1e3, 4),
            "noise_floor": round(gain.noise_floor * 1e3, 4),
            "reducible_removed": {
                "value": round(value, 4),
                "low": round(low, 4),
                "high": round(high, 4),
            },
            "paper_metric": {
                "baseline": round(gain.paper[0] * 1e3, 4),
                "extended": round(gain.paper[1] * 1e3, 4),
            },
            "probes": gain.probes,
        }
        if gain.tuned is not None:
            report["gain"]["tuned"] = dict(
                zip(("value", "low", "high"), (round(part, 4) for part in gain.tuned), strict=True)
            )
        if gain.force is not None:
            names = ("baseline", "extended", "noise_floor")
            report["gain"]["force"] = {"unit": "N"} | {
                n: round(v, 5) for n, v in zip(names, gain.force, strict=True)
            }
    return report


def _modulus(
    bench: Bench, findings: Findings, named: set[str]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What the data tell of Young's modulus where it is no cause: its entry of `identified`, or
    that of `not_identifiable`.
    """
    if YoungModulus.name in named:
        return [], []
    model = findings.best.model if findings.best else findings.baseline
    interval = modulus_interval(bench, model)
    if interval is None:
        why = "the tool is driven by position and no force was measured: a block of any stiffness takes the same shape"
        return [], [
            _unknown(
                why, "the force on the tool (forces.csv), or a drop of known weight on the block"
            )
        ]
    value, low, high = interval
    if high > CRITERIA.verdict.most_modulus_ratio * value:
        why = f"the measured forces leave anything between {low:.3g} and {high:.3g} Pa open: they hardly stand out of their noise"
        return [], [_unknown(why, "deeper pushes, or with a sensor of less noise")]
    stated = bench.setup.material.young_modulus
    why = f"the measured forces fix it within {100 * (high / value - 1):.0f} %; {stated:.4g} Pa were stated"
    parameters = {"E": {"value": value, "unit": "Pa", "low": low, "high": high}}
    return [
        {"effect": YoungModulus.name, "why": why, "stated": stated, "parameters": parameters}
    ], []


def _unknown(why: str, instead: str) -> dict[str, str]:
    return {"effect": YoungModulus.name, "why": why, "measure_instead": instead}
