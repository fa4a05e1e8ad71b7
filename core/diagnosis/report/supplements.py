"""Supplements to a report that change no verdict: controls, identifiability, and the next probe."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from palpate.diagnosis.design.next_probe import next_probe
from palpate.diagnosis.design.profile_likelihood import profiles
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.findings import Findings
from palpate.diagnosis.validation.force_controls import force_controls
from palpate.diagnosis.validation.negative_controls import Control, controls, warnings_of

__all__ = ["with_supplements"]

_OPEN = ("ambiguous", "unexplained")
_TOUCH_AGAIN = "touch the landmarks once more, and name each as it is touched"


def with_supplements(
    report: dict[str, Any], evaluator: Evaluator, data: Sequence[Observations], findings: Findings
) -> dict[str, Any]:
    """Add `controls`, `next_probe` and the `identifiability` of the causes' parameters to a report.

    A control that a cause does not pass is a warning, and changes no verdict.
    """
    checked: Sequence[Control] = ()
    names: dict[str, dict[str, str]] = {}
    open_rows: list[dict[str, Any]] = []
    if findings.best:
        model = findings.best.model
        if not findings.known:  # without that nothing can be replayed, and so nothing falsified
            checked = (
                controls(evaluator, data, model, findings.baseline)
                if evaluator.problem.clouds
                else force_controls(evaluator, model, findings.baseline)
            )
        identifiability, open_rows = profiles(evaluator, findings.best.model)
        names = dict(zip(findings.best.model.names, identifiability, strict=True))
    return {
        **report,
        "causes": [
            _identified(cause, names.get(cause["effect"], {})) for cause in report["causes"]
        ],
        "not_identifiable": [*report["not_identifiable"], *open_rows],
        "controls": [one.to_json() for one in checked],
        "next_probe": _next_probe(report, evaluator, data, findings),
        "warnings": [*report["warnings"], *warnings_of(checked)],
    }


def _next_probe(
    report: dict[str, Any], evaluator: Evaluator, data: Sequence[Observations], findings: Findings
) -> list[dict[str, Any]]:
    """Measurements that would tell more; none where the verdict leaves nothing open."""
    if findings.known:
        again = {"kind": "measurement", "separates": [findings.known[0].name, "none"]}
        return [{**again, "text": _TOUCH_AGAIN}]
    if report["verdict"] not in _OPEN or not evaluator.problem.clouds:
        return []
    return next_probe(evaluator, data, findings)


def _identified(cause: dict[str, Any], identifiability: dict[str, str]) -> dict[str, Any]:
    """Add `identifiability` to the parameters of a cause that were profiled."""
    entries = {
        name: {**entry, "identifiability": identifiability[name]}
        if name in identifiability
        else entry
        for name, entry in cause["parameters"].items()
    }
    return {**cause, "parameters": entries}
