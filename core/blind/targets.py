"""Targets of the blind suite, and their judgement."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from palpate.blind.calibration import calibration_error, first_effect
from palpate.blind.case_results import CaseResult
from palpate.blind.located_causes import NEAR, centre_error, centre_errors, line_share, line_shares
from palpate.blind.parameter_errors import (
    SCORED_LEVEL,
    coverage,
    distances,
    reported_parameters,
    words_right,
)
from palpate.blind.proportions import IntervalEstimate, median_of, share_of

__all__ = ["TARGETS", "Target", "grade", "judge_targets"]

CLEAR, SUBTLE = 5.0, 2.0
"""Size over the detection limit from which an effect is clear, and from which it is subtle [1]."""

LEAST_LINE = 0.8
"""Share of a tube's length that is to be found [1]."""

Measure = Callable[[Sequence[CaseResult]], IntervalEstimate]


def grade(result: CaseResult) -> str:
    """Grade `clear`, `subtle` or `faint` by the size over the detection limit, empty without."""
    if result.size is None:
        return ""
    return "clear" if result.size >= CLEAR else "subtle" if result.size >= SUBTLE else "faint"


@dataclass(frozen=True)
class Target:
    """A figure that must lie within bounds.

    Attributes:
        key: identifier.
        text: for a person.
        measure: computes the figure from all results.
        low: lower bound; None without.
        high: upper bound; None without.
        unit: of the figure; `1` for a share.
    """

    key: str
    text: str
    measure: Measure
    low: float | None = None
    high: float | None = None
    unit: str = "1"

    def judge(self, results: Sequence[CaseResult]) -> dict[str, Any]:
        """Plain values: bounds, figure, `met`, and `sure` where the whole interval lies on one
        side; `met` and `sure` are None without cases.
        """
        estimate = self.measure(results)
        met = None if estimate.value is None else self._within(estimate.value)
        ends = [end for end in (estimate.low, estimate.high) if end is not None]
        agree = (
            len(ends) == 2
            and all(self._within(end) == met for end in ends)
            and not self._straddles(ends)
        )
        return {
            "key": self.key,
            "text": self.text,
            "unit": self.unit,
            "at_least": self.low,
            "at_most": self.high,
            "reached": estimate.to_json(),
            "met": met,
            "sure": None if met is None else agree,
        }

    def _within(self, value: float) -> bool:
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)

    def _straddles(self, ends: Sequence[float]) -> bool:
        """Whether both bounds lie between the ends, so that the figure may be within."""
        return (
            self.low is not None
            and self.high is not None
            and ends[0] < self.low
            and ends[1] > self.high
        )


def judge_targets(results: Sequence[CaseResult]) -> list[dict[str, Any]]:
    """Judge all targets by these results."""
    return [target.judge(results) for target in TARGETS]


def _of(kind: str) -> Callable[[Sequence[CaseResult]], list[CaseResult]]:
    return lambda results: [result for result in results if result.case.kind == kind]


def _graded(expected: str) -> Callable[[Sequence[CaseResult]], list[CaseResult]]:
    """Select single effects of this grade, of any kind of case."""
    return lambda results: [
        result for result in results if len(result.truth) == 1 and grade(result) == expected
    ]


def _told_pairs(results: Sequence[CaseResult]) -> list[CaseResult]:
    """Select pairs of effects that are both above twice their detection limit."""
    return [
        result
        for result in results
        if result.case.kind == "pair" and grade(result) in ("clear", "subtle")
    ]


def _share(
    chosen: Callable[[Sequence[CaseResult]], list[CaseResult]], holds: Callable[[CaseResult], bool]
) -> Measure:
    return lambda results: share_of(chosen(results), holds)


def _median(effect: str, *names: str) -> Measure:
    return lambda results: median_of(distances(_of("clear")(results), effect, names))


def _word(effect: str, name: str) -> Measure:
    return lambda results: words_right(_of("clear")(results)).get(
        f"{effect}.{name}", share_of([], bool)
    )


def _covered(results: Sequence[CaseResult]) -> IntervalEstimate:
    return coverage(reported_parameters(results), SCORED_LEVEL)


def _removed(chosen: Callable[[Sequence[CaseResult]], list[CaseResult]]) -> Measure:
    return lambda results: median_of([result.removed or 0.0 for result in chosen(results)])


def _on_shapes(kind: str, effect: str = "") -> Callable[[Sequence[CaseResult]], list[CaseResult]]:
    """Select cases of a kind on shapes, all or those that hide an effect."""
    return lambda results: [
        result
        for result in results
        if result.case.kind == kind
        and result.case.shape is not None
        and (not effect or effect in result.truth)
    ]


def _centre_found(result: CaseResult) -> bool:
    error = centre_error(result)
    return error is not None and error <= NEAR


def _line_found(result: CaseResult) -> bool:
    return (line_share(result) or 0.0) >= LEAST_LINE


_ALONE, _AMONG = "it is named first", "it is among what is named"
_FAMILY = "One of a family that looks alike: first, or in an ambiguous set"

TARGETS = (
    Target(
        "clear.first",
        f"One clear effect, as drawn: {_ALONE}",
        _share(_of("clear"), lambda r: r.first),
        0.95,
    ),
    Target(
        "clear.inside",
        f"One clear effect, as drawn: {_AMONG}",
        _share(_of("clear"), lambda r: r.inside),
        0.99,
    ),
    Target(
        "subtle.first",
        f"One subtle effect, as drawn: {_ALONE}",
        _share(_of("subtle"), lambda r: r.first),
        0.85,
    ),
    Target(
        "limit_clear.first",
        f"One of 5 detection limits or more: {_ALONE}",
        _share(_graded("clear"), lambda r: r.first),
        0.95,
    ),
    Target(
        "limit_clear.inside",
        f"One of 5 detection limits or more: {_AMONG}",
        _share(_graded("clear"), lambda r: r.inside),
        0.99,
    ),
    Target(
        "limit_subtle.first",
        f"One of 2 to 5 detection limits: {_ALONE}",
        _share(_graded("subtle"), lambda r: r.first),
        0.85,
    ),
    Target(
        "control.named",
        "Nothing hidden: a cause is named",
        _share(_of("control"), lambda r: bool(r.named)),
        high=0.02,
    ),
    Target(
        "pair.exact",
        "Two effects: both and only both are named",
        _share(_of("pair"), lambda r: r.exact),
        0.80,
    ),
    Target(
        "limit_pair.exact",
        "Two of 2 detection limits or more: both, only both",
        _share(_told_pairs, lambda r: r.exact),
        0.80,
    ),
    Target(
        "outside.right",
        "Outside the catalogue: unexplained or ambiguous",
        _share(_of("outside"), lambda r: r.right),
        0.90,
    ),
    Target("twins.right", _FAMILY, _share(_of("twins"), lambda r: r.right), 0.95),
    Target(
        "modulus.right",
        "Another modulus alone: reported as not identifiable",
        _share(_of("modulus"), lambda r: r.right),
        0.95,
    ),
    Target("coverage", "90 % intervals of parameters that hold the truth", _covered, 0.85, 0.95),
    Target(
        "calibration",
        "Calibration error, most probable effect",
        lambda r: calibration_error(*first_effect(r)),
        high=0.05,
    ),
    Target(
        "inclusion.plane",
        "Inclusion, centre in the plane",
        _median("stiff_inclusion", "x", "y"),
        high=2.5e-3,
        unit="m",
    ),
    Target(
        "inclusion.depth", "Inclusion, depth", _median("stiff_inclusion", "z"), high=3e-3, unit="m"
    ),
    Target("tool_radius", "Tool radius", _median("tool_radius", "radius"), high=0.3e-3, unit="m"),
    Target("time_offset", "Clock", _median("time_offset", "offset"), high=5e-3, unit="s"),
    Target(
        "poisson_ratio", "Poisson's ratio", _median("poisson_ratio", "nu"), high=0.02, unit="nu"
    ),
    Target(
        "camera.shift",
        "Camera, shift",
        _median("camera_registration", "tx", "ty", "tz"),
        high=0.3e-3,
        unit="m",
    ),
    Target(
        "camera.turn",
        "Camera, turn",
        _median("camera_registration", "rx", "ry", "rz"),
        high=math.radians(0.3),
        unit="rad",
    ),
    Target("depth_bias.scale", "Misread depth, scale", _median("depth_bias", "scale"), high=5e-3),
    Target(
        "geometry_scale.height",
        "Another size, height",
        _median("geometry_scale", "scale_z"),
        high=0.01,
    ),
    Target(
        "landmark_mismatch.scale",
        "Touches of other places, scale",
        _median("landmark_mismatch", "scale"),
        high=0.02,
    ),
    Target(
        "landmark_mismatch.pairing",
        "Touches of other places, pairing",
        _word("landmark_mismatch", "pairing"),
        0.95,
    ),
    Target(
        "removed",
        "One clear effect, as drawn: reducible error removed, median",
        _removed(_of("clear")),
        0.85,
    ),
    Target(
        "limit_clear.removed",
        "One of 5 detection limits or more: reducible error removed",
        _removed(_graded("clear")),
        0.85,
    ),
    Target(
        "shapes.clear.first",
        f"On shapes, one clear effect: {_ALONE}",
        _share(_on_shapes("clear"), lambda r: r.first),
        24 / 25,
    ),
    Target(
        "shapes.control.named",
        "On shapes, nothing hidden: a cause is named",
        _share(_on_shapes("control"), lambda r: bool(r.named)),
        high=0.0,
    ),
    Target(
        "shapes.inclusion.centre",
        "On shapes, inclusion: error of its centre",
        lambda r: median_of(centre_errors(_on_shapes("clear")(r))),
        high=NEAR,
        unit="m",
    ),
    Target(
        "shapes.inclusion.near",
        f"On shapes, inclusion: named, its centre within {NEAR * 1e3:g} mm",
        _share(_on_shapes("clear", "stiff_inclusion"), _centre_found),
        1.0,
    ),
    Target(
        "shapes.tube.line",
        f"On shapes, tube: share of its length within {NEAR * 1e3:g} mm",
        lambda r: median_of(line_shares(_on_shapes("clear")(r))),
        LEAST_LINE,
    ),
    Target(
        "shapes.tube.near",
        f"On shapes, tube: named, {LEAST_LINE * 100:g} % of its length so near",
        _share(_on_shapes("clear", "stiff_tube"), _line_found),
        1.0,
    ),
)
"""Targets. Errors are medians over clear cases. Chosen, not derived: 95 % for look-alikes and the
modulus alone; for depth, size and touches the smallest step of each parameter that matters."""
