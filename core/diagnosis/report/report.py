"""The report of a diagnosis: verdict, causes with intervals, ranking of effects, what the data
cannot determine, and the error that is left.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from scipy.stats import beta

from palpate.dataset import Dataset
from palpate.dataset.check.plausibility import frame_notes, implausible_values
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.gain.force_gain import ForceGain
from palpate.diagnosis.gain.surface_gain import SurfaceGain
from palpate.diagnosis.inference.credible_intervals import intervals
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.noise.mesh_discrepancy import too_coarse
from palpate.diagnosis.report.identified_modulus import modulus_entries
from palpate.diagnosis.report.model_probabilities import probabilities
from palpate.diagnosis.report.remaining_error import small_remainder, unexplained_error
from palpate.diagnosis.search.findings import Findings, Trial, shared_family
from palpate.diagnosis.validation.checks import AllClearChecks
from palpate.effects import NuisanceBlock

__all__ = ["report_of", "verdict_of"]

_NO_CHECKS = AllClearChecks()


def verdict_of(findings: Findings, checks: AllClearChecks = _NO_CHECKS) -> str:
    """Return the verdict: found, none, ambiguous or unexplained."""
    if findings.best is None:
        unclear = findings.structured or findings.poor or findings.contradicted
        return "unexplained" if unclear or checks.failed else "none"
    if findings.rivals():
        return "ambiguous"
    return "found"


def _probabilities(findings: Findings) -> dict[tuple[str, ...], float]:
    """Probability of each set of causes that was tried, by its best fit, and of no cause."""
    surplus: dict[tuple[str, ...], float] = {}
    for trial in findings.trials:
        surplus[trial.model.names] = max(
            trial.gain - trial.required_gain, surplus.get(trial.model.names, -np.inf)
        )
    # Where the best law is wrong, a difference of gains says less about the cause.
    doubt = findings.doubtful / CRITERIA.naming.rival
    return probabilities(surplus, doubt * CRITERIA.naming.probability_temperature)


def _removed(findings: Findings, misfit: float) -> float:
    """Share of the misfit above noise that a model removes on the fitted sequences [1]; zero where
    the stated model has none.
    """
    return 1.0 - findings.share_left(misfit) if findings.misfit > 1.0 else 0.0


def _causes(evaluator: Evaluator, findings: Findings, trials: list[Trial]) -> list[dict[str, Any]]:
    """Named causes with probability and parameters; a cause that rival sets share comes once."""
    chances = _probabilities(findings)
    rows: list[dict[str, Any]] = []
    for trial in trials:
        for effect, entry in zip(
            trial.model.effects, intervals(evaluator, trial.model), strict=True
        ):
            if any(row["effect"] == effect.name for row in rows):
                continue
            chance = sum(p for names, p in chances.items() if effect.name in names)
            row = {"effect": effect.name, "probability": round(chance, 4), "parameters": entry}
            rows.append(row | effect.located(trial.model.setup))
    return rows


def _family(findings: Findings, trials: list[Trial]) -> dict[str, Any] | None:
    """The family of the effects in which all named sets differ, with what is sure; None where
    they differ in more.
    """
    if len(trials) < 2:
        return None
    first, *others = trials
    families = {shared_family(first.model.effects, one.model.effects) for one in others}
    family = families.pop() if len(families) == 1 else None
    if family is None:
        return None
    shared = set(first.model.names).intersection(*(one.model.names for one in others))
    return {
        "name": family.name,
        "sure": family.sure,
        "parted_by": family.parted_by,
        "members": [
            {"effect": name, "left": round(1.0 - _removed(findings, trial.misfit), 4)}
            for trial in trials
            for name in trial.model.names
            if name not in shared
        ],
    }


def _ranking(evaluator: Evaluator, findings: Findings, named: set[str]) -> list[dict[str, Any]]:
    """Effects that are not named, by the gain as the only cause: fitted, or else linear."""
    chances = _probabilities(findings)
    rows = []
    for kind in evaluator.problem.applicable:
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
        if kind.name in findings.hints:
            row["hint"] = findings.hints[kind.name]
        rows.append(row)
    return sorted(rows, key=lambda row: -row["gain_nats"])


def _model(trial: Trial, cut_short: Collection[tuple[str, ...]]) -> dict[str, Any]:
    """A set of causes that was fitted, with its gain split by block of data.

    Args:
        trial: the fit.
        cut_short: names of the sets whose fit ended at its budget of work.
    """
    blocks = [*(block.name for block in trial.model.blocks), "stated accuracies"]
    parts = [
        {"of": name, "gain_nats": round(part, 2)}
        for name, part in zip(blocks, trial.parts, strict=bool(trial.parts))
    ]
    effects = [effect.to_json() for effect in trial.model.effects]
    # A set that is refused although its gain is large enough has an infinite required gain.
    required = round(trial.required_gain, 2) if np.isfinite(trial.required_gain) else None
    gain, misfit = round(trial.gain, 2), round(trial.misfit, 4)
    return {
        "effects": effects,
        "gain_nats": gain,
        "asked_nats": required,
        "misfit": misfit,
        "parts": parts,
        **({"cut_short": True} if trial.model.names in cut_short else {}),
    }


def _all_clear(checks: AllClearChecks) -> dict[str, Any]:
    """Results of the checks behind a verdict of none; empty for other verdicts."""
    entries: dict[str, Any] = {}
    if checks.held_out is not None:
        beyond = checks.held_out.structure
        entries["held_out_structure"] = round(beyond.ratio, 4)
        entries["held_out_structure_bound"] = round(beyond.bound / beyond.expected, 4)
    if checks.stiffness_errors:
        entries["local_stiffness_error"] = [one.to_json() for one in checks.stiffness_errors]
    return entries


def report_of(
    dataset: Dataset,
    evaluator: Evaluator,
    findings: Findings,
    gain: SurfaceGain | ForceGain | None,
    split: str,
    checks: AllClearChecks = _NO_CHECKS,
) -> dict[str, Any]:
    """Build the report as it is written to report.json.

    Args:
        dataset: that was diagnosed.
        evaluator: the fitted sequences.
        findings: of the search.
        gain: on held-out sequences; None without them.
        split: their split.
        checks: of an all-clear.
    """
    verdict = verdict_of(findings, checks)
    best = [findings.best] if findings.best else []
    trials = [*best, *findings.rivals()] if verdict == "ambiguous" else best
    causes = _causes(evaluator, findings, trials)
    named = {cause["effect"] for cause in causes}
    known, unknown = modulus_entries(evaluator, findings, named)
    return {
        "format": 1,
        "dataset": dataset.name,
        **_frame(dataset),
        "verdict": verdict,
        "causes": causes,
        **({"family": family} if (family := _family(findings, trials)) else {}),
        "interval_level": CRITERIA.intervals.level,
        "criteria": CRITERIA.to_json(),
        "ranking": _ranking(evaluator, findings, named),
        "models": [_model(trial, evaluator.state.cut_short) for trial in findings.trials],
        "identified": known,
        "not_identifiable": unknown,
        "unexplained": unexplained_error(evaluator, findings, checks),
        "small_remainder": small_remainder(evaluator, findings, checks),
        "gain": None if gain is None else gain.to_json(split),
        "ambiguity_map": [one.to_json() for one in findings.identifiability],
        "evidence": _evidence(evaluator, findings, checks),
        "warnings": [
            *implausible_values(dataset.config, dataset.geometry),
            *frame_notes(dataset.config),
            *_warnings(evaluator, findings, checks),
        ],
    }


def _frame(dataset: Dataset) -> dict[str, Any]:
    """The turn to the upright frame of all places here; empty where the files are in it."""
    turn = dataset.config.phantom_from_file.matrix
    return {} if np.array_equal(turn, np.eye(4)) else {"phantom_from_file": turn.tolist()}


def _evidence(evaluator: Evaluator, findings: Findings, checks: AllClearChecks) -> dict[str, Any]:
    """Figures behind the verdict."""
    structure = findings.structure
    return {
        "gain_nats": round(findings.best.gain, 2) if findings.best else 0.0,
        "bound_nats": round(findings.bound, 2),
        "bounds_nats": {name: round(bound, 2) for name, bound in findings.bounds.items()},
        **({} if findings.test_gain is None else {"test_gain_nats": round(findings.test_gain, 2)}),
        "baseline_misfit": round(findings.misfit, 4),
        "structure": round(structure.ratio, 4),
        "structure_bound": round(structure.bound / structure.expected, 4),
        "evaluations": evaluator.state.evaluations,
        "equilibria": evaluator.state.work,
        "fitted_on": list(evaluator.problem.names),
        **_false_alarms(findings),
        **_all_clear(checks),
    }


def _false_alarms(findings: Findings) -> dict[str, Any]:
    """How often this data's noise, pushes and camera would name a cause where there is none.

    A share of draws of the noise model, and the upper end of its interval (Clopper and Pearson
    1934); structured error by chance has the probability that its test is made for.
    """
    draws = len(findings.chance.gains)
    if not draws:
        return {}
    named = findings.chance.named(findings.bounds)
    level = CRITERIA.intervals.level
    most = float(beta.ppf(level, named + 1, draws - named)) if named < draws else 1.0
    return {
        "false_alarms": {
            "named": round(named / draws, 4),
            "named_at_most": round(most, 4),
            "structured": round(1 - CRITERIA.structure.quantile, 4),
            "draws": draws,
        }
    }


def _warnings(evaluator: Evaluator, findings: Findings, checks: AllClearChecks) -> list[str]:
    """Sentences for people, those of the registration first."""
    problem, coarse = evaluator.problem, ""
    if not evaluator.state.on_diagnosis_grid:
        kinds = problem.effects_sharing(NuisanceBlock.MESH_ERROR)
        screened = max((findings.screened.get(kind.name, 0.0) for kind in kinds), default=0.0)
        coarse = too_coarse(screened, findings.bound)
    texts = (
        findings.withdrawn,
        *_cut_short(evaluator, findings),
        coarse,
        findings.ripple.warning,
        checks.unusual.warning if checks.unusual else "",
    )
    return [*problem.registration.warnings, *(text for text in texts if text)]


def _cut_short(evaluator: Evaluator, findings: Findings) -> list[str]:
    """A sentence if the fit of a set that is named, or nearly, ended at its budget of work."""
    close = [trial.model.names for trial in (findings.best, *findings.rivals()) if trial]
    names = [" and ".join(one) for one in close if one in evaluator.state.cut_short]
    return [
        f"the fit of {name} ended at its budget of work, before its numbers had settled"
        for name in names
    ]
