"""When a cause that the fitted sequences ask for is not named after all (step 10 of the method)."""

from __future__ import annotations

from core.diagnosis.felt_gain import FeltLadder
from core.diagnosis.findings import Findings
from core.diagnosis.gain import Ladder

__all__ = ["objection"]

_WORSE = 0.1
"""Share of the reducible error that a cause surely adds on test sequences before it is withdrawn [1]: less may be the mesh's."""
_LEFT = 0.5
"""Share of the structure over chance that a cause may leave at most [1], where the test sequences do not speak for it."""


def objection(findings: Findings, gain: Ladder | FeltLadder | None) -> str:
    """Why the causes found are not named; empty where nothing speaks against them."""
    if findings.best is None:
        return ""
    names = " and ".join(findings.best.model.names)
    return _harm(names, gain) or _no_explanation(names, findings, gain)


def _harm(names: str, gain: Ladder | FeltLadder | None) -> str:
    """They do not carry over: the test sequences get worse."""
    if gain is None or gain.removed[2] > -_WORSE:
        return ""
    value, low, high = gain.removed
    return (
        f"{names} would explain the sequences that were fitted on, but makes the test sequences worse: it adds "
        f"{-100 * value:.0f} % ({-100 * high:.0f} to {-100 * low:.0f} %) of the reducible error there, and is not named"
    )


def _no_explanation(names: str, findings: Findings, gain: Ladder | FeltLadder | None) -> str:
    """They remove something, but what is wrong stays: smooth error that grows with the push is nearly as large as before."""
    before, left = findings.structure, findings.left
    most = _LEFT * max(before.ratio - 1.0, 0.0)
    if not left.significant or left.ratio - 1.0 < most or (gain is not None and gain.removed[1] > 0.0):
        return ""
    tested = "" if gain is None else f", and the test sequences are no better ({100 * gain.removed[0]:.0f} % removed)"
    return (
        f"{names} would explain part of the sequences that were fitted on, but the error that is smooth over the surface and "
        f"grows with the push stays: {left.ratio:.1f} times what chance gives, {before.ratio:.1f} times without it{tested}. "
        "It is not named"
    )
