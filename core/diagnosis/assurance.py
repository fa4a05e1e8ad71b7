"""What a report says beyond its verdict: whether the causes pass their controls, and which push to make next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from core.diagnosis.bench import Bench
from core.diagnosis.controls import controls, warnings_of
from core.diagnosis.next_probe import next_probe
from core.diagnosis.observations import Observations
from core.diagnosis.search import Findings

__all__ = ["assured"]


def assured(report: dict[str, Any], bench: Bench, data: Sequence[Observations], findings: Findings) -> dict[str, Any]:
    """The report with `controls` and `next_probe`; a control that a cause does not pass is a warning, and changes no verdict."""
    checked = controls(bench, data, findings.best.model, findings.baseline) if findings.best else ()
    return {
        **report,
        "controls": [one.to_json() for one in checked],
        "next_probe": next_probe(bench, data, findings),
        "warnings": [*report["warnings"], *warnings_of(checked)],
    }
