"""How far off the parameters of rightly named causes are, and how often their intervals hold the
truth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from scipy.stats import norm

from palpate.blind.case_results import CaseResult
from palpate.blind.proportions import IntervalEstimate, median_of, rate, share_of
from palpate.effects import Parameter, effect_named
from palpate.foundation.errors import EffectError

__all__ = [
    "SCORED_LEVEL",
    "ReportedParameter",
    "coverage",
    "distances",
    "parameter_errors",
    "reported_parameters",
    "words_right",
]

SCORED_LEVEL = 0.9
"""Of the intervals that are scored: those of a report are narrowed to it as a normal distribution's
would be."""


@dataclass(frozen=True)
class ReportedParameter:
    """One number of a rightly named cause.

    Attributes:
        case, kind: where.
        effect, name, unit: of the parameter.
        true, value: hidden and said, SI.
        low, high: as the report states them, at its `level` [1]; None without.
        searched: how a search moves it; None where its effect is not known here.
    """

    case: str
    kind: str
    effect: str
    name: str
    unit: str
    true: float
    value: float
    low: float | None = None
    high: float | None = None
    level: float = 0.95
    searched: Parameter | None = None

    @property
    def key(self) -> str:
        """`effect.parameter`."""
        return f"{self.effect}.{self.name}"

    @property
    def nearest(self) -> float:
        """The truth; of a direction, that of its turns which is next to what is said."""
        if self.searched is None or not self.searched.periodic:
            return self.true
        period = self.searched.high - self.searched.low
        return self.true + period * round((self.value - self.true) / period)

    @property
    def error(self) -> float:
        """Reported minus true value, SI units."""
        return self.value - self.nearest

    def covers(self, level: float | None = None) -> bool | None:
        """Whether the interval holds the truth; at another level as a normal distribution's would.
        None without an interval.
        """
        if self.low is None or self.high is None:
            return None
        narrower = (
            1.0
            if level is None
            else float(norm.ppf(0.5 + level / 2) / norm.ppf(0.5 + self.level / 2))
        )
        low, value, high, true = (
            self._coordinate(one) for one in (self.low, self.value, self.high, self.nearest)
        )
        # A rounded end must not decide.
        slack = 1e-9 * max(abs(high - low), abs(value))
        return bool(
            value + narrower * (low - value) - slack
            <= true
            <= value + narrower * (high - value) + slack
        )

    def _coordinate(self, value: float) -> float:
        if self.searched is None:
            return value
        return self.searched.coordinate(max(value, 1e-300) if self.searched.log else value)


def reported_parameters(results: Iterable[CaseResult]) -> list[ReportedParameter]:
    """Every number of every cause that is named and hidden."""
    found = []
    for result in results:
        causes = {cause["effect"]: cause["parameters"] for cause in result.causes}
        for hidden in result.hidden:
            entries = causes.get(hidden["effect"], {})
            for name, true in hidden["parameters"].items():
                if name in entries and isinstance(true["value"], (int, float)):
                    found.append(
                        _reported_parameter(result, hidden["effect"], name, true, entries[name])
                    )
    return found


def _reported_parameter(
    result: CaseResult, effect: str, name: str, true: dict[str, Any], entry: dict[str, Any]
) -> ReportedParameter:
    return ReportedParameter(
        result.name,
        result.case.kind,
        effect,
        name,
        true["unit"],
        float(true["value"]),
        float(entry["value"]),
        entry.get("low"),
        entry.get("high"),
        result.level,
        _parameter(effect, name),
    )


def _parameter(effect: str, name: str) -> Parameter | None:
    try:
        return next((item for item in effect_named(effect).numbers() if item.name == name), None)
    except EffectError:  # an effect of a package that is not installed here
        return None


def parameter_errors(said: Sequence[ReportedParameter]) -> dict[str, dict[str, Any]]:
    """By `effect.parameter`: unit, median and largest absolute error, mean signed error, and the
    share of intervals that hold.
    """
    keys = list(dict.fromkeys(one.key for one in said))
    table = {}
    for key in keys:
        own = [one for one in said if one.key == key]
        sizes = [abs(one.error) for one in own]
        table[key] = {
            "unit": own[0].unit,
            "median": median_of(sizes).to_json(),
            "largest": float(f"{max(sizes):.6g}"),
            "mean_signed": float(f"{sum(one.error for one in own) / len(own):.6g}"),
            "covered": coverage(own, SCORED_LEVEL).to_json(),
        }
    return table


def coverage(said: Iterable[ReportedParameter], level: float | None = None) -> IntervalEstimate:
    """Share of the intervals at this level, or as stated, that hold the truth."""
    held = [one.covers(level) for one in said]
    return rate(sum(one is True for one in held), sum(one is not None for one in held))


def distances(results: Iterable[CaseResult], effect: str, names: Sequence[str]) -> list[float]:
    """Length of the error vector of these parameters of one effect, in each case where it is
    rightly named.
    """
    found: dict[str, list[float]] = {}
    for one in reported_parameters(results):
        if one.effect == effect and one.name in names:
            found.setdefault(one.case, []).append(one.error)
    return [math.hypot(*errors) for errors in found.values()]


def words_right(results: Iterable[CaseResult]) -> dict[str, IntervalEstimate]:
    """By `effect.parameter`: how often a word (an edge) is that of the truth, where the effect is
    rightly named.
    """
    pairs: dict[str, list[bool]] = {}
    for result in results:
        causes = {cause["effect"]: cause["parameters"] for cause in result.causes}
        for hidden in result.hidden:
            entries = causes.get(hidden["effect"], {})
            for name, true in hidden["parameters"].items():
                if name in entries and isinstance(true["value"], str):
                    pairs.setdefault(f"{hidden['effect']}.{name}", []).append(
                        entries[name]["value"] == true["value"]
                    )
    return {key: share_of(answers, bool) for key, answers in pairs.items()}
