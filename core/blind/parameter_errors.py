"""Errors of the parameters of correctly named causes, and coverage of their intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from scipy.stats import norm

from palpate.blind.case_results import CaseResult
from palpate.blind.located_causes import same_way
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
"""Level of the scored intervals [1]; those of a report are narrowed to it as for a normal
distribution."""


@dataclass(frozen=True)
class ReportedParameter:
    """A numeric parameter of a correctly named cause, SI units.

    Attributes:
        case: name of the case.
        kind: of the case.
        effect: name.
        name: of the parameter.
        unit: of the parameter.
        true: hidden value.
        value: reported value.
        low: end of the reported interval; None without.
        high: end of the reported interval; None without.
        level: of the interval [1].
        searched: the parameter's coordinate; None for an unknown effect.
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
        """The name `effect.parameter`."""
        return f"{self.effect}.{self.name}"

    @property
    def nearest(self) -> float:
        """The true value; of a periodic parameter the one nearest to the reported value."""
        if self.searched is None or not self.searched.periodic:
            return self.true
        period = self.searched.high - self.searched.low
        return self.true + period * round((self.value - self.true) / period)

    @property
    def error(self) -> float:
        """Reported minus true value, SI units."""
        return self.value - self.nearest

    def covers(self, level: float | None = None) -> bool | None:
        """Whether the interval contains the truth; None without an interval.

        At another `level` [1] the interval is scaled as for a normal distribution.
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
        # Rounding of the interval's ends must not matter.
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
    """List every number of every cause that is named and hidden.

    Of an effect that was hidden by its second law only those that mean the same under both laws.
    """
    from palpate.synthetic.laws import SECOND_LAWS

    found = []
    for result in results:
        causes = {cause["effect"]: cause["parameters"] for cause in result.causes}
        for hidden in result.hidden:
            entries = causes.get(hidden["effect"], {})
            if hidden.get("second_law"):
                kept = SECOND_LAWS[hidden["effect"]].kept
                entries = {name: entry for name, entry in entries.items() if name in kept}
            for name, true in same_way(hidden["parameters"], entries).items():
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


def parameter_errors(reported: Sequence[ReportedParameter]) -> dict[str, dict[str, Any]]:
    """Table by `effect.parameter`: unit, median and largest absolute error, mean signed error, and
    coverage of the intervals.
    """
    keys = list(dict.fromkeys(one.key for one in reported))
    table = {}
    for key in keys:
        own = [one for one in reported if one.key == key]
        sizes = [abs(one.error) for one in own]
        table[key] = {
            "unit": own[0].unit,
            "median": median_of(sizes).to_json(),
            "largest": float(f"{max(sizes):.6g}"),
            "mean_signed": float(f"{sum(one.error for one in own) / len(own):.6g}"),
            "covered": coverage(own, SCORED_LEVEL).to_json(),
        }
    return table


def coverage(reported: Iterable[ReportedParameter], level: float | None = None) -> IntervalEstimate:
    """Share of the intervals at this level, or as stated, that contain the truth."""
    covered = [one.covers(level) for one in reported]
    return rate(sum(one is True for one in covered), sum(one is not None for one in covered))


def distances(results: Iterable[CaseResult], effect: str, names: Sequence[str]) -> list[float]:
    """Norms of the errors of these parameters of an effect, for each case where it is correctly
    named.
    """
    found: dict[str, list[float]] = {}
    for one in reported_parameters(results):
        if one.effect == effect and one.name in names:
            found.setdefault(one.case, []).append(one.error)
    return [math.hypot(*errors) for errors in found.values()]


def words_right(results: Iterable[CaseResult]) -> dict[str, IntervalEstimate]:
    """Share of correct words (edges, pairings) by `effect.parameter`, for named hidden effects."""
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
