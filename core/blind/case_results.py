"""Results of blind cases, their scores, and the file of results."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from palpate.blind.cases import Case
from palpate.foundation.errors import RunError

__all__ = ["RESULTS_FILE", "STATED_LEVEL", "CaseResult", "add_result", "read_results"]

RESULTS_FILE = "results.jsonl"
STATED_LEVEL = 0.95
"""Level of the intervals in a report without `interval_level` [1]."""

MODULUS = "young_modulus"


@dataclass(frozen=True)
class CaseResult:
    """Result of one case.

    Attributes:
        case: that was run.
        hidden: effects with their parameters, as in a truth file.
        report: of the diagnosis, with the ambiguity map only of hidden effects; empty after an
            error.
        outside: disturbances with their parameters, as in a truth file.
        size: of the hidden effect over its detection limit [1], of two effects the smaller one;
            None without a limit.
        seconds: duration of the diagnosis [s].
        code: digest of the sources.
        error: message that ended the case; empty without.
    """

    case: Case
    hidden: list[dict[str, Any]] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)
    outside: list[dict[str, Any]] = field(default_factory=list)
    size: float | None = None
    seconds: float = 0.0
    code: str = ""
    error: str = ""

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.case.name

    @property
    def verdict(self) -> str:
        """Verdict of the report, or `error`."""
        return "error" if self.error else str(self.report["verdict"])

    @property
    def causes(self) -> list[dict[str, Any]]:
        """Named causes, the best first; of an ambiguous verdict all that explain the data."""
        return list(self.report.get("causes", []))

    @property
    def named(self) -> tuple[str, ...]:
        """Names of the causes' effects, the best first."""
        return tuple(cause["effect"] for cause in self.causes)

    @property
    def truth(self) -> frozenset[str]:
        """Names of the hidden effects."""
        outside = self.case.kind in ("outside", "fault")
        return frozenset() if outside else frozenset(self.case.hidden)

    @property
    def second_law(self) -> bool:
        """Whether any effect was hidden by its second law."""
        return any(hidden.get("second_law", False) for hidden in self.hidden)

    @property
    def stating(self) -> frozenset[str]:
        """Names of the effects that state the fault of the bench; empty for other kinds."""
        from palpate.synthetic import FAULTS

        fault = self.case.kind == "fault"
        return frozenset(name for one in self.case.hidden if fault for name in FAULTS[one].causes)

    @property
    def right(self) -> bool:
        """Whether the verdict is correct for the kind of the case.

        A hidden effect must be found exactly; outside of the catalogue no single cause may be
        named; of look-alikes the truth must be first or in an ambiguous set; a modulus alone must
        be reported as not identifiable, or named where it is; for a fault nothing but an effect
        that states it may be named.
        """
        if self.case.kind == "fault":
            return self.verdict in ("found", "none") and set(self.named) <= self.stating
        if self.case.kind == "outside":
            return self.verdict in ("unexplained", "ambiguous")
        if self.case.kind == "twins":
            return self.first or (self.verdict == "ambiguous" and self.inside)
        if self.case.kind == "modulus" and not (
            self.verdict == "found" and not self.modulus_not_identifiable
        ):
            return self.verdict == "none" and self.modulus_not_identifiable
        return self.exact if self.truth else self.verdict == "none"

    @property
    def exact(self) -> bool:
        """Whether the verdict is found, with exactly the hidden effects."""
        return self.verdict == "found" and set(self.named) == self.truth

    @property
    def first(self) -> bool:
        """Whether the first named effect is hidden."""
        return bool(self.named) and self.named[0] in self.truth

    @property
    def inside(self) -> bool:
        """Whether all hidden effects are named."""
        return bool(self.truth) and self.truth <= set(self.named)

    @property
    def false_name(self) -> bool:
        """Whether an effect is named that is not hidden.

        The others of an ambiguous verdict do not count, if the truth is among them.
        """
        if self.verdict == "ambiguous" and (self.inside or self.outside):
            return False
        return bool(set(self.named) - self.truth - self.stating)

    @property
    def modulus_not_identifiable(self) -> bool:
        """Whether the report says that Young's modulus is not identifiable."""
        return any(row["effect"] == MODULUS for row in self.report.get("not_identifiable", []))

    @property
    def removed(self) -> float | None:
        """Share [1] of the reducible error on test sequences that the named causes remove."""
        value = ((self.report.get("gain") or {}).get("reducible_removed") or {}).get("value")
        return None if value is None else float(value)

    @property
    def gain(self) -> float:
        """Gain of the named causes, or the largest one of those not named [nats]."""
        gains = [row.get("gain_nats", 0.0) for row in self.report.get("ranking", [])]
        return (
            float(self.report["evidence"]["gain_nats"] if self.causes else max(gains, default=0.0))
            if self.report
            else 0.0
        )

    @property
    def bound(self) -> float:
        """Least gain of a named cause [nats]."""
        return float(self.report["evidence"]["bound_nats"]) if self.report else 0.0

    @property
    def level(self) -> float:
        """Level of the report's parameter intervals [1]."""
        return float(self.report.get("interval_level", STATED_LEVEL))

    @property
    def probabilities(self) -> dict[str, float]:
        """Probability of each effect in the report [1]."""
        return {
            row["effect"]: float(row["probability"])
            for row in (*self.causes, *self.report.get("ranking", []))
        }

    def to_json(self) -> dict[str, Any]:
        """Plain values of one row of the file."""
        return {
            "case": self.case.to_json(),
            "hidden": self.hidden,
            "outside": self.outside,
            "report": self.report,
            "size": self.size,
            "seconds": self.seconds,
            "code": self.code,
            "error": self.error,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> CaseResult:
        """Read the output of `to_json`."""
        return cls(**{**data, "case": Case.from_json(data["case"])})


def read_results(file: Path, mend: bool = False) -> list[CaseResult]:
    """Read all whole rows; an incomplete last row, as a killed process leaves it, is ignored.

    Args:
        file: of results.
        mend: whether an incomplete last row is removed from the file.

    Raises:
        RunError: for any other row that is no result.
    """
    if not file.is_file():
        return []
    lines = file.read_text().splitlines()
    results = []
    for number, line in enumerate(lines, 1):
        try:
            results.append(CaseResult.from_json(json.loads(line)))
        except (ValueError, TypeError, KeyError) as error:
            if number == len(lines):
                if mend:
                    _rewrite(file, lines[:-1])
                break
            text = (
                f"{file}, row {number} is not a result of this suite ({error}); remove the "
                "row to have it done again"
            )
            raise RunError(text, row=number) from error
    return results


def add_result(file: Path, result: CaseResult) -> None:
    """Append a row, on disk when this returns."""
    with file.open("a") as stream:
        stream.write(json.dumps(result.to_json()) + "\n")
        stream.flush()
        os.fsync(stream.fileno())


def _rewrite(file: Path, lines: Iterable[str]) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text("".join(line + "\n" for line in lines))
    os.replace(aside, file)
