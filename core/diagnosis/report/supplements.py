"""What a report says beyond its verdict: controls, what of each cause the data determine, and which
push to make next.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from palpate.diagnosis.design.next_probe import next_probe
from palpate.diagnosis.design.profile_likelihood import profiles
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.findings import Findings
from palpate.diagnosis.validation.force_controls import force_controls
from palpate.diagnosis.validation.negative_controls import Control, controls, warnings_of
from palpate.effects.tool import LandmarkMismatch

__all__ = ["with_supplements"]

_AGAIN = {
    "kind": "measurement",
    "separates": [LandmarkMismatch.name, "none"],
    "text": "touch the landmarks once more, and name each as it is touched",
}


def with_supplements(
    report: dict[str, Any], bench: Bench, data: Sequence[Observations], findings: Findings
) -> dict[str, Any]:
    """The report with `controls` and `next_probe`, and `identifiability` of each parameter of the
    best model's causes.

    A control that a cause does not pass is a warning, and changes no verdict.
    """
    checked: Sequence[Control] = ()
    names: dict[str, dict[str, str]] = {}
    open_rows: list[dict[str, Any]] = []
    if findings.best:
        model = findings.best.model
        if not findings.known:  # without that nothing can be replayed, and so nothing falsified
            checked = (
                controls(bench, data, model, findings.baseline)
                if bench.seen
                else force_controls(bench, model, findings.baseline)
            )
        told, open_rows = profiles(bench, findings.best.model)
        names = dict(zip(findings.best.model.names, told, strict=True))
    return {
        **report,
        "causes": [
            _identified(cause, names.get(cause["effect"], {})) for cause in report["causes"]
        ],
        "not_identifiable": [*report["not_identifiable"], *open_rows],
        "controls": [one.to_json() for one in checked],
        "next_probe": [_AGAIN]
        if findings.known
        else next_probe(bench, data, findings)
        if bench.seen
        else [],
        "warnings": [*report["warnings"], *warnings_of(checked)],
    }


def _identified(cause: dict[str, Any], told: dict[str, str]) -> dict[str, Any]:
    """The cause whose parameters say how well they are determined, those that were looked at."""
    entries = {
        name: {**entry, "identifiability": told[name]} if name in told else entry
        for name, entry in cause["parameters"].items()
    }
    return {**cause, "parameters": entries}
