"""Rejection of causes that the fitted sequences support and the held-out ones contradict."""

from __future__ import annotations

from collections.abc import Collection

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.gain.force_gain import ForceGain
from palpate.diagnosis.gain.surface_gain import SurfaceGain
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.search.findings import Findings, Trial

__all__ = ["leaves_structure", "rejection_reason"]


def rejection_reason(
    findings: Findings, gain: SurfaceGain | ForceGain | None, as_stated: Collection[str] = ()
) -> str:
    """Return the reason why found causes are not named; empty if nothing contradicts them.

    Args:
        findings: of the search.
        gain: on test sequences; None without them.
        as_stated: names of the causes of which every number may be as stated.
    """
    if findings.best is None:
        return ""
    names = " and ".join(findings.best.model.names)
    return (
        _harm(names, gain)
        or _no_explanation(names, findings, gain)
        or _faint(names, findings)
        or _unconfirmed(names, findings, gain)
        or _indistinct(names, findings, as_stated)
    )


def _harm(names: str, gain: SurfaceGain | ForceGain | None) -> str:
    """Return the reason if the causes make the held-out sequences worse."""
    if isinstance(gain, SurfaceGain) and not any(gain.removed):
        return _added(names, gain)
    if gain is None or gain.removed[2] > -CRITERIA.rejection.added_error:
        return ""
    value, low, high = gain.removed
    return (
        f"{names} would explain the sequences that were fitted on, but makes the test sequences "
        f"worse: it adds {-100 * value:.0f} % ({-100 * high:.0f} to {-100 * low:.0f} %) of the "
        "reducible error there, and is not named"
    )


def _added(names: str, gain: SurfaceGain) -> str:
    """Return the reason if the causes add error to held-out sequences that have none to remove."""
    if gain.added <= CRITERIA.rejection.added_rms:
        return ""
    return (
        f"{names} would explain the sequences that were fitted on, but makes the test sequences "
        f"worse: their error grows from {1e3 * gain.baseline:.2g} to {1e3 * gain.extended:.2g} mm, "
        f"surely by {1e3 * gain.added:.2g} mm, and is not named"
    )


def _no_explanation(names: str, findings: Findings, gain: SurfaceGain | ForceGain | None) -> str:
    """Return the reason if most of the structured error, and of the reducible error on held-out
    sequences, is left.
    """
    before, left = findings.structure, findings.remaining
    if not leaves_structure(before, left, None if gain is None else gain.removed[0]):
        return ""
    tested = (
        ""
        if gain is None
        else f", and of the reducible error on test sequences {_share(gain)} is removed"
    )
    return (
        f"{names} would explain part of the sequences that were fitted on, but the error that is "
        f"smooth over the surface and grows with the push stays: {left.ratio:.1f} times what "
        f"chance gives, {before.ratio:.1f} times without it{tested}. It is not named"
    )


def _unconfirmed(names: str, findings: Findings, gain: SurfaceGain | ForceGain | None) -> str:
    """Return the reason if neither structured error nor the held-out sequences confirm the causes.

    A large gain alone does not: backlash of a robot was taken for a late clock by 54 nats. It is
    enough where the held-out sequences have no reducible error and can confirm nothing. Causes that
    touches and the rest cloud confirm are exempt: pushes need not show them.
    """
    best = findings.best
    if best is None or gain is None or findings.structure.significant or gain.removed[1] > 0.0:
        return ""
    if not any(gain.removed) and best.gain > _far_above(findings, best):
        return ""
    if _gain_at_rest(best) >= CRITERIA.rejection.least_at_rest:
        return ""
    return (
        f"{names} would explain the data by {best.gain:.0f} nats, but no error that is smooth over "
        f"the surface and grows with the push is there, and on test sequences {_share(gain)} of "
        "the reducible error is removed. It is a hint, and is not named"
    )


def _gain_at_rest(best: Trial) -> float:
    """Return the gain on touches and rest cloud [nats]; zero where the causes do not show there."""
    if not any(effect.at_rest() for effect in best.model.effects):
        return 0.0
    # The last part is that of the stated accuracies.
    blocks = zip(best.model.blocks, best.parts[:-1], strict=True)
    return sum(part for block, part in blocks if block.name == "rest")


def _indistinct(names: str, findings: Findings, as_stated: Collection[str]) -> str:
    """Return the reason if every number of every cause may be as stated, by intervals that include
    the replay's own error, no structured error is there, and the gain is not far above the bound.
    """
    best = findings.best
    if best is None or findings.structure.significant or not set(best.model.names) <= {*as_stated}:
        return ""
    if best.gain > _far_above(findings, best):
        return ""
    return (
        f"{names} would explain the data by {best.gain:.0f} nats, but the intervals of all its "
        "numbers include what is stated, and no error that is smooth over the surface and grows "
        "with the push is there. It is a hint, and is not named"
    )


def _far_above(findings: Findings, best: Trial) -> float:
    """Return the gain [nats] from which on a cause needs no confirmation."""
    return CRITERIA.rejection.unconfirmed_gain * max(best.required_gain, findings.bound)


def _faint(names: str, findings: Findings) -> str:
    """Return the reason if the gains on fitted and test sequences together are below the bound."""
    best, more = findings.best, findings.test_gain
    if best is None or best.gain + (more or 0.0) >= findings.bound:
        return ""
    tested = (
        "there are no test sequences with clouds"
        if more is None
        else f"test sequences add {more:.0f}"
    )
    return (
        f"{names} would explain the data by {best.gain:.0f} nats, more than chance gives, and "
        f"{tested}; {findings.bound:.0f} in all are asked for. It is a hint, and is not named"
    )


def leaves_structure(before: Structure, left: Structure, removed: float | None) -> bool:
    """Whether a cause leaves most of the error.

    That is: the structure that is left is significant and at least `CRITERIA.rejection.left_share`
    of that without the cause, and so is the reducible error on held-out sequences.

    Args:
        before: structure without the cause.
        left: structure with it.
        removed: share of the reducible error that it removes on held-out sequences [1]; None
            without them.
    """
    stays = left.significant and left.ratio - 1.0 >= CRITERIA.rejection.left_share * max(
        before.ratio - 1.0, 0.0
    )
    return stays and (removed is None or removed <= 1.0 - CRITERIA.rejection.left_share)


def _share(gain: SurfaceGain | ForceGain) -> str:
    value, low, high = gain.removed
    return f"{100 * value:.0f} % ({100 * low:.0f} to {100 * high:.0f} %)"
