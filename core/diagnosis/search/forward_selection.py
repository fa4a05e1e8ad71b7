"""The search for causes: screen the catalogue, refit what deserves it, accept what chance cannot
give, one after another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import TRACED
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.camera_error_model import CALM
from palpate.diagnosis.inference.credible_intervals import stands
from palpate.diagnosis.inference.evidence import predictive_gain
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.residual_structure import structure_of
from palpate.diagnosis.search.candidates import (
    Signature,
    begin,
    candidates_of,
    lump_places,
    renewed,
    signatures,
    tangents,
)
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.identifiability import ambiguity_map
from palpate.diagnosis.search.screening import (
    Candidate,
    linear_gains,
    null_gains,
    pair_gains,
    right_sides,
)
from palpate.diagnosis.search.shortlist import beyond_first_order, shortlist
from palpate.diagnosis.search.touch_pairing import mispaired
from palpate.effects import Effect
from palpate.effects.base import with_effects

__all__ = ["search"]


Screening = tuple[Model, list[Candidate], np.ndarray]
"""A model with the catalogue as columns, the candidates, and the linear gain of each [nats]."""


def _screen(bench: Bench, model: Model, finite: Sequence[Signature], origin: Model) -> Screening:
    with_columns = bench.block_with(model, finite, origin)
    candidates = candidates_of(with_columns, bench, finite)
    blocks = bench.tempered(with_columns)
    nuisance = (*with_columns.nuisance, *with_columns.columns)
    gains = linear_gains(
        blocks, right_sides(blocks), nuisance, bench.held(with_columns), candidates
    )[0]
    return with_columns, candidates, gains


def _trial(
    bench: Bench,
    effects: Sequence[Effect],
    starts: Sequence[Prediction],
    against: Model,
    hopeless: float = -np.inf,
) -> Trial:
    model = bench.refit(effects, starts, hopeless)
    gain = predictive_gain(bench.score(model), bench.score(against))[0]
    return Trial(model, gain, bench.misfit(model))


def search(bench: Bench, seed: int) -> Findings:
    """Find the causes, one after another, up to `CRITERIA.naming.most_causes`."""
    bench.tell("replaying the stated setup on two meshes", 0.02)
    known = mispaired(bench.setup, bench.grid, bench.registration.repair)
    names = [effect.name for effect in known]
    origin = bench.baseline(
        tangents(with_effects(bench.setup, known), names, bench.weighed), lump_places(bench), known
    )
    baseline = bench.evaluate((), origin.predictions) if known else origin
    findings = Findings(baseline, misfit=bench.misfit(baseline), known=known)
    findings.ripple = bench.static.cloud.errors.ripple if bench.static else CALM
    findings.structure = findings.left = structure_of(bench, origin, seed)
    finite = signatures(bench, origin)
    first = screened, candidates, gains = _screen(bench, origin, finite, origin)
    blocks, nuisance = bench.tempered(screened), (*screened.nuisance, *screened.columns)
    chance = null_gains(
        blocks, nuisance, bench.precision(screened), candidates, CRITERIA.naming.null_draws, seed
    )
    findings.bound = max(
        float(np.quantile(chance, CRITERIA.naming.null_quantile)), CRITERIA.naming.least_gain
    )
    findings.told = ambiguity_map(
        blocks, nuisance, bench.precision(screened), candidates, findings.bound
    )
    for candidate, gain in zip(candidates, gains, strict=True):
        name = candidate.start.name
        findings.screened[name] = max(float(gain), findings.screened.get(name, -np.inf))
    current = Trial(baseline, 0.0, findings.misfit)
    if known:
        current = findings.best = replace(
            _trial(bench, known, origin.predictions, baseline), asked=findings.bound
        )
        findings.trials.append(current)
    for order in range(len(known), CRITERIA.naming.most_causes):
        bench.tell(
            "looking for a second cause" if order else "fitting the most promising causes",
            0.45 + 0.25 * order,
        )
        if order:
            screened, candidates, gains = _again(bench, current.model, finite, origin)
        step = _forward(bench, findings, current, screened, candidates, gains)
        if step is None:
            break
        current = findings.best = step
        bench.temperature = max(1.0, current.misfit)
        findings.left = structure_of(bench, current.model, seed)
    grown = findings.best
    if findings.left.significant and not known:
        _paired(bench, findings, current, first, seed)
    if findings.best is not None and len(findings.best.model.effects) > 1 and not known:
        findings.best = _reconsidered(bench, findings, findings.best, grown, finite, origin)
    _rescore(bench, findings)
    if findings.best is not None:
        refined = bench.refine(findings.best.model)
        findings.best = replace(findings.best, model=refined, misfit=bench.misfit(refined))
        findings.left = structure_of(bench, findings.best.model, seed)
    return findings


def _again(bench: Bench, model: Model, finite: Sequence[Signature], origin: Model) -> Screening:
    """Screen the catalogue on top of a model that has causes already."""
    wanted = tangents(model.setup, model.names, bench.weighed)
    extended = bench.evaluate(model.effects, model.predictions, wanted, lump_places(bench))
    return _screen(bench, extended, renewed(bench, extended, finite, origin), origin)


def _forward(
    bench: Bench,
    findings: Findings,
    current: Trial,
    screened: Model,
    candidates: list[Candidate],
    gains: np.ndarray,
) -> Trial | None:
    """The best further cause that gains more than the bound and that is no accident of one
    sequence, else None.
    """
    trials, needed = list[Trial](), _needed(findings, current)
    settled = (
        beyond_first_order(bench, screened, candidates)
        if _asks_for_more(findings, current, gains)
        else []
    )
    chosen = shortlist(gains, candidates, CRITERIA.naming.promising * needed, settled)
    before, linear = (
        bench.objective(current.model),
        {id(one): gain for one, gain in zip(candidates, gains, strict=True)},
    )
    # What is dear, or refitted whatever its gain, comes last, when a better one may show that it is
    # hopeless.
    for candidate in sorted(
        chosen, key=lambda one: (isinstance(one.start, TRACED), one in settled)
    ):
        hopeless = max(
            [before, *(bench.objective(trial.model) - CRITERIA.naming.hopeless for trial in trials)]
        )
        if (
            isinstance(candidate.start, TRACED)
            and before + CRITERIA.naming.history_optimism * linear[id(candidate)] < hopeless
        ):
            continue
        effects = [*current.model.effects, begin(candidate, screened, bench)]
        trial = _trial(bench, effects, current.model.predictions, current.model, hopeless)
        trials.append(replace(trial, asked=current.asked + needed))
    trials.sort(key=lambda trial: -trial.gain)
    enough = [trial for trial in trials if trial.gain > needed]
    best = next((trial for trial in enough if stands(bench, trial.model, current.model)), None)
    if best is None:
        trials = [replace(trial, asked=np.inf) if trial in enough else trial for trial in trials]
    findings.trials.extend(trial if trial is best else trial.scored() for trial in trials)
    return best


def _asks_for_more(findings: Findings, current: Trial, gains: np.ndarray) -> bool:
    """Whether what a tangent knows little of is refitted: for a first cause, where something is
    left, or where more might be named.

    A tool 1.5 mm off its place, whose tangent promised too little beside a material that stiffens,
    else loses unseen to another size of the block, which moves the sides that are seen by about as
    much.
    """
    promising = bool((gains > CRITERIA.naming.promising * _needed(findings, current)).any())
    return current.model.names == _known(findings) or findings.left.significant or promising


def _paired(
    bench: Bench, findings: Findings, current: Trial, screening: Screening, seed: int
) -> None:
    """Take two causes at once that leave no structure where one after another did: each alone may
    look like a third.

    A stated setup of which two things are wrong can be nearer to a third cause than to either of
    them (Tropp 2004, on greedy pursuit), so that every step forward is a wrong one. Such a pair
    promises more than the best single cause, by as much as a step forward asks for; the others are
    the cause found beside anything, which the steps forward have weighed.
    """
    screened, candidates, _ = screening
    blocks, nuisance = bench.tempered(screened), (*screened.nuisance, *screened.columns)
    more = CRITERIA.naming.promising * CRITERIA.naming.second_factor * findings.bound
    ranked = pair_gains(
        blocks, right_sides(blocks), nuisance, bench.precision(screened), candidates, more
    )
    for _, one, other in ranked[: CRITERIA.naming.most_pairs]:
        bench.tell(f"trying {one.start.name} and {other.start.name} at once")
        effects = [begin(one, screened, bench, other), begin(other, screened, bench, one)]
        hopeless = bench.objective(current.model) - CRITERIA.naming.hopeless
        trial = _trial(bench, effects, findings.baseline.predictions, findings.baseline, hopeless)
        trial = replace(trial, asked=current.asked + CRITERIA.naming.second_factor * findings.bound)
        gain = predictive_gain(bench.score(trial.model), bench.score(current.model))[0]
        left = structure_of(bench, trial.model, seed)
        if gain > CRITERIA.naming.second_factor * findings.bound and not left.significant:
            findings.trials.append(trial)
            findings.best, findings.left = trial, left
            bench.temperature = max(1.0, trial.misfit)
            return
        findings.trials.append(
            replace(trial.scored(), asked=np.inf if left.significant else trial.asked)
        )


def _known(findings: Findings) -> tuple[str, ...]:
    return tuple(effect.name for effect in findings.known)


def _needed(findings: Findings, current: Trial) -> float:
    """Least gain [nats] of the next cause.

    The mesh's error is known for the stated setup only; a found cause changes it, and what changes
    with it could pass for another cause. So a second one must gain a good deal more than chance,
    and a share of what the first gained unless what is left has a structure that the noise has not.
    (On top of the only cause, of 84 to 14 780 nats, the best of the catalogue has at most 40. Of
    two causes one can show a fifth of what the other does, and leave no structure.) What nothing
    could be replayed without was there when the noise was measured, and is no first cause in this
    sense.
    """
    if current.model.names == _known(findings):
        return findings.bound
    share = 0.0 if findings.left.significant else CRITERIA.naming.second_share
    return max(CRITERIA.naming.second_factor * findings.bound, share * current.gain)


def _reconsidered(
    bench: Bench,
    findings: Findings,
    best: Trial,
    grown: Trial | None,
    finite: Sequence[Signature],
    origin: Model,
) -> Trial:
    """Drop each cause in turn, for what a later one explains as well need not stay; or exchange it
    for one that does better.

    The last cause of a model that was `grown` by steps forward was weighed against all others
    beside the same causes just before.
    """
    for name in best.model.names:
        if best is grown and name == best.model.names[-1]:
            break
        rest = [effect for effect in best.model.effects if effect.name != name]
        if len(rest) == len(best.model.effects):  # exchanged already
            continue
        without = _trial(bench, rest, best.model.predictions, findings.baseline)
        without = replace(without, asked=best.asked - findings.bound)
        lost = predictive_gain(bench.score(best.model), bench.score(without.model))[0]
        if lost <= findings.bound:
            findings.trials.append(without)
            return without
        findings.trials.append(without.scored())
        best = _exchanged(
            bench, findings, (best, without), lost, _again(bench, without.model, finite, origin)
        )
    return best


def _exchanged(
    bench: Bench, findings: Findings, trials: tuple[Trial, Trial], lost: float, screening: Screening
) -> Trial:
    """The best of two trials, or one with another cause beside the second's, should that be better
    still.

    Args:
        trials: with a cause and without it.
        lost: what it is worth [nats].
        screening: of the catalogue beside the second.
    """
    (best, without), (screened, candidates, gains) = trials, screening
    others = [
        number
        for number, candidate in enumerate(candidates)
        if candidate.start.name not in best.model.names
    ]
    for candidate in shortlist(
        gains[others], [candidates[number] for number in others], CRITERIA.naming.promising * lost
    )[: CRITERIA.naming.most_rivals]:
        effects = [*without.model.effects, begin(candidate, screened, bench)]
        bench.tell(f"trying {candidate.start.name} instead")
        other = _trial(
            bench,
            effects,
            without.model.predictions,
            findings.baseline,
            bench.objective(best.model) - CRITERIA.naming.hopeless,
        )
        other = replace(other, asked=best.asked)
        better = predictive_gain(bench.score(other.model), bench.score(best.model))[0] > 0
        if better and stands(bench, other.model, without.model):
            findings.trials.append(other)
            best = other
        else:
            findings.trials.append(other.scored())
    return best


def _rescore(bench: Bench, findings: Findings) -> None:
    """Gains of all trials over the baseline at one temperature, that of the model accepted, so that
    they compare.
    """
    reference = bench.score(findings.baseline)
    rescored = []
    for trial in findings.trials:
        parts = bench.score(trial.model) - reference
        rescored.append(replace(trial, gain=float(parts.sum()), parts=tuple(parts.tolist())))
    best = findings.best
    findings.trials = sorted(rescored, key=lambda trial: -trial.gain)
    if best is not None:
        findings.best = next(trial for trial in findings.trials if trial.model is best.model)
