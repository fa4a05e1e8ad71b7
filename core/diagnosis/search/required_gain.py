"""The gain that a further cause must reach, and what a faint one must remove instead."""

from __future__ import annotations

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.search.findings import Findings, Trial

__all__ = ["gain_to_try", "known_names", "removes_misfit", "removes_structure", "required_gain"]


def required_gain(findings: Findings, current: Trial, name: str, removes: bool = False) -> float:
    """Return the least gain [nats] of an effect as the next cause.

    The mesh error is known for the stated setup only. A found cause changes it, and that change
    could pass for another cause. A second cause must therefore gain a good deal more than chance,
    and a share of the first gain unless it removes most of what the first leaves. (Measured: on top
    of the only cause, of 84 to 14 780 nats, the best of the catalogue has at most 40. Of two causes
    one can show a hundredth of what the other shows.) An effect without which nothing can be
    replayed was there when the noise was measured, and is no first cause in this sense.

    Args:
        findings: so far.
        current: model that the effect would extend.
        name: of the effect.
        removes: whether the effect removes most of the misfit above noise, or of the significant
            structure, that the model leaves.
    """
    if current.model.names == known_names(findings):
        return findings.bound_of(name)
    share = 0.0 if removes else CRITERIA.naming.second_share
    return max(CRITERIA.naming.second_factor * findings.bound, share * current.gain)


def known_names(findings: Findings) -> tuple[str, ...]:
    """Return the names of the effects without which nothing can be replayed."""
    return tuple(effect.name for effect in findings.known)


def removes_misfit(current: Trial, trial: Trial) -> bool:
    """Return whether a further cause removes most of the misfit above noise that a model leaves.

    Where a model leaves none there is nothing to remove.
    """
    left = current.misfit - 1.0
    return left > 0.0 and trial.misfit - 1.0 <= CRITERIA.naming.second_left * left


def removes_structure(before: Structure, after: Structure) -> bool:
    """Return whether a further cause removes most of the significant structure beyond chance.

    Args:
        before: structure that the model leaves.
        after: structure that the model leaves with the further cause.
    """
    left = before.ratio - 1.0
    return before.significant and after.ratio - 1.0 <= CRITERIA.naming.second_left * left


def gain_to_try(findings: Findings, current: Trial, name: str) -> float:
    """Return the least gain [nats] with which an effect can be named as the next cause.

    Without history the first lower bound will do, as trials are cheap there. Beside history a trial
    takes minutes, and it must gain the whole that `required_gain` asks for, or at least what
    removes enough of the misfit above noise or of the significant structure.
    """
    least = required_gain(findings, current, name, True)
    if not current.model.has_history:
        return least
    removed = 1.0 - CRITERIA.naming.second_left
    ways = [required_gain(findings, current, name)]
    if current.misfit > 1.0:
        values = sum(block.values for block in current.model.blocks if block.name != "rest")
        ways.append(removed * (current.misfit - 1.0) * values / 2.0)
    if findings.remaining.significant:
        ways.append(removed * (findings.remaining.value - findings.remaining.expected) / 2.0)
    return max(least, min(ways))
