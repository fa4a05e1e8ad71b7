"""Results of the blind suite, made by hand."""

from __future__ import annotations

from typing import Any

from palpate.blind import Case, CaseResult

NOT_IDENTIFIABLE = [
    {"effect": "young_modulus", "why": "no force was measured", "measure_instead": "the force"}
]


def cause(
    effect: str, probability: float = 0.99, **parameters: tuple[float, float, float]
) -> dict[str, Any]:
    """One named cause; each parameter as (value, low, high) in a unit of its own."""
    entries = {
        name: {"value": value, "unit": "m", "low": low, "high": high}
        for name, (value, low, high) in parameters.items()
    }
    return {"effect": effect, "probability": probability, "parameters": entries}


def result(
    kind: str,
    hidden: str = "",
    verdict: str = "none",
    causes: list[dict[str, Any]] | None = None,
    *,
    name: str = "case",
    truth: dict[str, Any] | None = None,
    ranking: dict[str, float] | None = None,
    removed: float | None = None,
    not_identifiable: bool = True,
    size: float | None = None,
    error: str = "",
) -> CaseResult:
    """What was hidden (names with blanks between them, `truth` their parameters) and what was said;
    ranking: probabilities.
    """
    names = tuple(hidden.split())
    entries = {
        key: {"value": value, "unit": "" if isinstance(value, str) else "m"}
        for key, value in (truth or {}).items()
    }
    effects = [] if kind == "outside" else [{"effect": one, "parameters": entries} for one in names]
    report: dict[str, Any] = {
        "verdict": verdict,
        "causes": causes or [],
        "not_identifiable": NOT_IDENTIFIABLE if not_identifiable else [],
        "ranking": [
            {"effect": one, "probability": chance, "gain_nats": 3.0}
            for one, chance in (ranking or {}).items()
        ],
        "evidence": {"gain_nats": 60.0, "bound_nats": 25.0},
        "gain": None,
    }
    if removed is not None:
        report["gain"] = {
            "extended": 0.3,
            "noise_floor": 0.2,
            "reducible_removed": {"value": removed},
        }
    outside = [{"effect": one, "parameters": {}} for one in names] if kind == "outside" else []
    case = Case(name, 0, kind, names)
    return CaseResult(case, effects, {} if error else report, outside, size, 100.0, "abc", error)
