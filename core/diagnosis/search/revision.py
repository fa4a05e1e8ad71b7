"""Revisions of what forward selection found: pairs at once, and causes dropped or exchanged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.credible_intervals import as_stated, is_supported_by_all_sequences
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.residual_structure import structure_of
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.initial_guess import initial_guess
from palpate.diagnosis.search.screening import pair_gains, right_sides
from palpate.diagnosis.search.shortlist import shortlist
from palpate.diagnosis.search.signatures import Signature
from palpate.diagnosis.search.trials import Screening, gain_over, screen_again, trial_of

__all__ = ["distinct", "reconsidered", "try_pairs"]


def try_pairs(
    evaluator: Evaluator, findings: Findings, current: Trial, screening: Screening, seed: int
) -> None:
    """Accept two causes at once that leave no structure, where forward selection left some.

    A stated setup with two errors can be nearer to a third cause than to either of them (Tropp
    2004, on greedy pursuit), so that every forward step is wrong. Such a pair promises more than
    the best single cause, by as much as a forward step must gain. Other pairs are the cause found
    beside anything, which the forward steps have weighed.

    Args:
        evaluator: of the inference problem.
        findings: to be changed.
        current: result of forward selection.
        screening: of the catalogue on top of the baseline.
        seed: of the draws from the noise model.
    """
    screened, candidates, _ = screening
    blocks, nuisance = evaluator.tempered(screened), (*screened.nuisance, *screened.columns)
    needed = CRITERIA.naming.second_factor * findings.bound
    more = CRITERIA.naming.promising * CRITERIA.naming.second_factor * findings.bound
    known = evaluator.precision(screened)
    ranked = pair_gains(blocks, right_sides(blocks), nuisance, known, candidates, more)
    for _, one, other in ranked[: CRITERIA.naming.most_pairs]:
        evaluator.report(f"trying {one.start.name} and {other.start.name} at once")
        effects = [
            initial_guess(one, screened, evaluator, other),
            initial_guess(other, screened, evaluator, one),
        ]
        hopeless = evaluator.objective(current.model) - CRITERIA.naming.hopeless
        baseline = findings.baseline
        trial = trial_of(evaluator, effects, baseline.predictions, baseline, hopeless)
        trial = replace(trial, required_gain=current.required_gain + needed)
        gain = gain_over(evaluator, trial.model, current.model)
        left = structure_of(evaluator, trial.model, seed)
        if gain > needed and not left.significant:
            findings.trials.append(trial)
            findings.best, findings.remaining = trial, left
            evaluator.state.temperature = max(1.0, trial.misfit)
            return
        required = np.inf if left.significant else trial.required_gain
        findings.trials.append(replace(trial.scored(), required_gain=required))


def reconsidered(
    evaluator: Evaluator,
    findings: Findings,
    grown: Trial | None,
    signatures: Sequence[Signature],
    origin: Model,
) -> Trial:
    """Return the best model after dropping or exchanging each of its causes in turn.

    Args:
        evaluator: of the inference problem.
        findings: with the best model so far.
        grown: result of forward selection, whose last cause was weighed against all others beside
            the same causes just before.
        signatures: of the effects that are screened at a finite size.
        origin: the model from which their changes are counted.
    """
    best = findings.best
    assert best is not None
    for name in best.model.names:
        if best is grown and name == best.model.names[-1]:
            break
        rest = [effect for effect in best.model.effects if effect.name != name]
        if len(rest) == len(best.model.effects):  # exchanged already
            continue
        without = trial_of(evaluator, rest, best.model.predictions, findings.baseline)
        without = replace(without, required_gain=best.required_gain - findings.bound)
        lost = gain_over(evaluator, best.model, without.model)
        if lost <= findings.bound:
            findings.trials.append(without)
            return without
        findings.trials.append(without.scored())
        screening = screen_again(evaluator, without.model, signatures, origin)
        best = _exchanged(evaluator, findings, (best, without), lost, screening)
    return best


def _exchanged(
    evaluator: Evaluator,
    findings: Findings,
    trials: tuple[Trial, Trial],
    lost: float,
    screening: Screening,
) -> Trial:
    """Return the first of two trials, or a better one with another cause beside the second's.

    Args:
        evaluator: of the inference problem.
        findings: to be extended.
        trials: with a cause and without it.
        lost: gain of that cause [nats].
        screening: of the catalogue on top of the second.
    """
    (best, without), (screened, candidates, gains) = trials, screening
    others = [
        number
        for number, candidate in enumerate(candidates)
        if candidate.start.name not in best.model.names
    ]
    least = CRITERIA.naming.promising * lost
    rivals = shortlist(gains[others], [candidates[number] for number in others], least)
    for candidate in rivals[: CRITERIA.naming.most_rivals]:
        effects = [*without.model.effects, initial_guess(candidate, screened, evaluator)]
        evaluator.report(f"trying {candidate.start.name} instead")
        hopeless = evaluator.objective(best.model) - CRITERIA.naming.hopeless
        starts = without.model.predictions
        other = trial_of(evaluator, effects, starts, findings.baseline, hopeless, without.model)
        other = replace(other, required_gain=best.required_gain)
        better = gain_over(evaluator, other.model, best.model) > 0
        if better and is_supported_by_all_sequences(evaluator, other.model, without.model):
            findings.trials.append(other)
            best = other
        else:
            findings.trials.append(other.scored())
    return best


def distinct(evaluator: Evaluator, findings: Findings) -> Trial:
    """Return the best model without further causes of which every number may be as stated.

    Such a cause becomes a hint, unless it gains far more than a further cause must.

    Args:
        evaluator: of the inference problem.
        findings: with a best model of several causes.
    """
    best = findings.best
    assert best is not None
    needed = CRITERIA.naming.second_factor * findings.bound
    for name in as_stated(evaluator, best.model):
        rest = [effect for effect in best.model.effects if effect.name != name]
        if not rest:
            break
        without = trial_of(evaluator, rest, best.model.predictions, findings.baseline)
        without = replace(without, required_gain=best.required_gain - needed)
        lost = gain_over(evaluator, best.model, without.model)
        if lost <= CRITERIA.rejection.unconfirmed_gain * needed:
            others = " and ".join(without.model.names)
            findings.hints[name] = (
                f"{name} beside {others} would gain {lost:.0f} nats, but the intervals of all its "
                "numbers include what is stated. It is a hint, and is not named"
            )
            findings.trials.append(without)
            best = without
        else:
            findings.trials.append(without.scored())
    return best
