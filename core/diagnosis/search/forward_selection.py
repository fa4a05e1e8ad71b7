"""The search for causes by forward selection.

The catalogue is screened, promising effects are refitted, and those are accepted whose gain chance
cannot give, one after another.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.credible_intervals import is_supported_by_all_sequences
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.final_fit import refine
from palpate.diagnosis.inference.noise.camera_error_model import CALM
from palpate.diagnosis.inference.noise.residual_structure import rms_beyond_noise, structure_of
from palpate.diagnosis.search.candidates import tangents_of
from palpate.diagnosis.search.chance_gains import ChanceGains
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.identifiability import identifiability_of
from palpate.diagnosis.search.inclusion_grid import screened_inclusions
from palpate.diagnosis.search.initial_guess import initial_guess
from palpate.diagnosis.search.required_gain import (
    gain_to_try,
    known_names,
    removes_misfit,
    removes_structure,
    required_gain,
)
from palpate.diagnosis.search.revision import distinct, reconsidered, try_pairs
from palpate.diagnosis.search.screening import Candidate
from palpate.diagnosis.search.shortlist import beyond_first_order, shortlist
from palpate.diagnosis.search.signatures import signatures_of
from palpate.diagnosis.search.touch_pairing import known_mismatch
from palpate.diagnosis.search.trials import (
    Screening,
    screen,
    screen_again,
    settled_trials,
    starts_around,
    trial_of,
)
from palpate.effects.base import with_effects

__all__ = ["search"]


def search(evaluator: Evaluator, seed: int) -> Findings:
    """Find the causes, one after another, up to `CRITERIA.naming.most_causes`.

    Args:
        evaluator: of the inference problem; its noise becomes known here.
        seed: of the draws from the noise model.
    """
    problem = evaluator.problem
    evaluator.report("replaying the stated setup on two meshes", 0.02)
    repair = problem.registration.repair
    known = known_mismatch(problem.catalogue, problem.setup, problem.grid, repair)
    names = [effect.name for effect in known]
    tangents = tangents_of(problem.applicable, with_effects(problem.setup, known), names)
    inclusions = screened_inclusions(problem)
    began = time.monotonic()
    origin = evaluator.baseline(tangents, inclusions.lumps, known, inclusions.spots)
    evaluator.expect(CRITERIA.screening.search_over_baseline * (time.monotonic() - began))
    baseline = evaluator.evaluate((), origin.predictions) if known else origin
    findings = Findings(baseline, misfit=evaluator.misfit(baseline), known=known)
    findings.excess = rms_beyond_noise(evaluator, baseline)
    findings.ripple = problem.at_rest.cloud.errors.ripple if problem.at_rest else CALM
    findings.structure = findings.remaining = structure_of(evaluator, origin, seed)
    signatures = signatures_of(evaluator, origin)
    screening = first = screen(evaluator, origin, signatures, origin)
    _state_limits(evaluator, findings, first, seed)
    current = Trial(baseline, 0.0, findings.misfit)
    if known:
        trial = trial_of(evaluator, known, origin.predictions, baseline)
        current = findings.best = replace(trial, required_gain=findings.bound)
        findings.trials.append(current)
    for order in range(len(known), CRITERIA.naming.most_causes):
        evaluator.report(
            "looking for a second cause" if order else "fitting the most promising causes",
            0.45 + 0.25 * order,
        )
        if order:
            screening = screen_again(evaluator, current.model, signatures, origin)
        step = _next_cause(evaluator, findings, current, screening, seed)
        if step is None:
            break
        current = findings.best = step
        evaluator.state.temperature = max(1.0, current.misfit)
        findings.remaining = structure_of(evaluator, current.model, seed)
    grown = findings.best
    if findings.remaining.significant and not known:
        try_pairs(evaluator, findings, current, first, seed)
    if findings.best is not None and len(findings.best.model.effects) > 1 and not known:
        findings.best = reconsidered(evaluator, findings, grown, signatures, origin)
        if len(findings.best.model.effects) > 1:
            findings.best = distinct(evaluator, findings)
    _rescore(evaluator, findings)
    if findings.best is not None:
        refined = refine(evaluator, findings.best.model)
        findings.best = replace(findings.best, model=refined, misfit=evaluator.misfit(refined))
        findings.remaining = structure_of(evaluator, findings.best.model, seed)
    evaluator.expect(None)
    return findings


def _state_limits(
    evaluator: Evaluator, findings: Findings, screening: Screening, seed: int
) -> None:
    """Put the bounds, the identifiability and the linear gains of the first screening."""
    extended, candidates, gains = screening
    blocks, nuisance = evaluator.tempered(extended), (*extended.nuisance, *extended.columns)
    known = evaluator.precision(extended)
    findings.chance = chance = ChanceGains.drawn(
        blocks, nuisance, known, candidates, CRITERIA.naming.null_draws, seed
    )
    findings.bound, findings.bounds = chance.bound, chance.bounds()
    findings.identifiability = identifiability_of(
        blocks, nuisance, known, candidates, findings.bound
    )
    for candidate, gain in zip(candidates, gains, strict=True):
        name = candidate.start.name
        findings.screened[name] = max(float(gain), findings.screened.get(name, -np.inf))


def _next_cause(
    evaluator: Evaluator, findings: Findings, current: Trial, screening: Screening, seed: int
) -> Trial | None:
    """Return the best further cause that gains more than the bound, by all sequences; or None.

    `seed` is that of the draws for the structure that a model leaves.
    """
    screened, candidates, gains = screening
    trials = list[Trial]()
    names, share = [one.start.name for one in candidates], CRITERIA.naming.promising
    lowest = [share * required_gain(findings, current, name, True) for name in names]
    least = share * np.array([gain_to_try(findings, current, name) for name in names])
    more = _refits_nonlinear(findings, current, gains > np.array(lowest))
    settled = beyond_first_order(evaluator, screened, candidates) if more else []
    chosen = shortlist(gains, candidates, least, settled)
    before = evaluator.objective(current.model)
    linear = {id(one): gain for one, gain in zip(candidates, gains, strict=True)}
    # Expensive candidates, and those that are refitted whatever their gain, come last, when a
    # better one may show that they are hopeless.
    for candidate in sorted(chosen, key=lambda one: (one.start.has_history(), one in settled)):
        hopeless = _hopeless(evaluator, before, trials)
        most = _most_promised(candidate, current, linear[id(candidate)])
        if candidate not in settled and before + most < hopeless:
            continue
        effects = [*current.model.effects, initial_guess(candidate, screened, evaluator)]
        starts = current.model.predictions
        trials.append(trial_of(evaluator, effects, starts, current.model, hopeless, current.model))
    for start in starts_around(evaluator, trials, current.model):
        hopeless = _hopeless(evaluator, before, trials)
        effects = [*current.model.effects, start]
        starts = current.model.predictions
        trials.append(trial_of(evaluator, effects, starts, current.model, hopeless, current.model))
    trials = _with_required_gains(evaluator, findings, current, trials, seed)
    enough = [trial for trial in trials if trial.gain > trial.required_gain - current.required_gain]
    best = next(
        (
            trial
            for trial in enough
            if is_supported_by_all_sequences(evaluator, trial.model, current.model)
        ),
        None,
    )
    if best is None:
        trials = [
            replace(trial, required_gain=np.inf) if trial in enough else trial for trial in trials
        ]
    findings.trials.extend(trial if trial is best else trial.scored() for trial in trials)
    return best


def _hopeless(evaluator: Evaluator, before: float, trials: Sequence[Trial]) -> float:
    """Return the log evidence [nats] below which a fit is given up.

    Args:
        evaluator: of the inference problem.
        before: log evidence of the model that is extended [nats].
        trials: that extend it.
    """
    least = CRITERIA.naming.hopeless
    return max([before, *(evaluator.objective(trial.model) - least for trial in trials)])


def _with_required_gains(
    evaluator: Evaluator, findings: Findings, current: Trial, trials: list[Trial], seed: int
) -> list[Trial]:
    """Return the trials of a further cause, best first, with the gain that each must reach.

    Args:
        evaluator: of the inference problem.
        findings: so far.
        current: model that they extend.
        trials: as fitted.
        seed: of the draws for the structure that they leave.
    """
    before = findings.remaining

    def needed(trial: Trial) -> float:
        name = trial.model.names[-1]
        least = required_gain(findings, current, name, True)
        whole = required_gain(findings, current, name)
        faint = before.significant and least < trial.gain <= whole
        removes = removes_misfit(current, trial) or (
            faint and removes_structure(before, structure_of(evaluator, trial.model, seed))
        )
        return least if removes else whole

    names = [trial.model.names[-1] for trial in trials]
    least = [CRITERIA.naming.promising * gain_to_try(findings, current, name) for name in names]
    trials = [
        replace(trial, required_gain=current.required_gain + needed(trial))
        for trial in settled_trials(evaluator, trials, current.model, least)
    ]
    return sorted(trials, key=lambda trial: -trial.gain)


def _most_promised(candidate: Candidate, current: Trial, linear: float) -> float:
    """Return what a fit may gain [nats]; infinite where it is cheap to try.

    Args:
        candidate: to be fitted.
        current: model that it would extend.
        linear: its linear gain [nats].
    """
    if candidate.start.has_history():
        return CRITERIA.naming.history_optimism * linear
    if current.model.has_history:
        return CRITERIA.fits.optimism[0] * max(linear, 0.0)
    return np.inf


def _refits_nonlinear(findings: Findings, current: Trial, promising: np.ndarray) -> bool:
    """Return whether strongly nonlinear effects are refitted whatever their linear gain.

    Args:
        findings: so far.
        current: model that they would extend.
        promising: whether the linear gain of each candidate (c,) is promising.

    They are for a first cause, where structure is left, and where more might be named. Otherwise a
    tool 1.5 mm off its place, whose tangent promises too little beside strain stiffening, loses
    unseen to another size of the block, which moves the visible sides by about as much.
    """
    first = current.model.names == known_names(findings)
    return first or findings.remaining.significant or bool(promising.any())


def _rescore(evaluator: Evaluator, findings: Findings) -> None:
    """Put the gains of all trials over the baseline at one temperature, that of the best model."""
    reference = evaluator.score(findings.baseline)
    rescored = []
    for trial in findings.trials:
        parts = evaluator.score(trial.model) - reference
        rescored.append(replace(trial, gain=float(parts.sum()), parts=tuple(parts.tolist())))
    best = findings.best
    findings.trials = sorted(rescored, key=lambda trial: -trial.gain)
    if best is not None:
        findings.best = next(trial for trial in findings.trials if trial.model is best.model)
