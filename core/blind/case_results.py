"""What one case gave, what is right about it, and the file of results."""

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
"""Of the intervals in a report that does not state its own as `interval_level`."""

MODULUS = "young_modulus"


@dataclass(frozen=True)
class CaseResult:
    """What was hidden and what was said.

    Attributes:
        hidden: effects with their parameters, as in a truth file.
        outside: disturbances that no effect expresses, likewise.
        report: as `palpate.diagnosis.pipeline` wrote it, its ambiguity map only for what is hidden;
            empty where the case ended in an error.
        size: of what is hidden over its detection limit [1], of two effects the fainter one's; None
            where no map gives it.
        seconds: of the diagnosis alone.
        code: digest of the sources that made it.
        error: what ended the case, if anything.
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
        """Of the case."""
        return self.case.name

    @property
    def verdict(self) -> str:
        """That of the report, or `error`."""
        return "error" if self.error else str(self.report["verdict"])

    @property
    def causes(self) -> list[dict[str, Any]]:
        """Named ones, the best first; of an ambiguous verdict all that explain the data."""
        return list(self.report.get("causes", []))

    @property
    def named(self) -> tuple[str, ...]:
        """Effects of the causes, the best first."""
        return tuple(cause["effect"] for cause in self.causes)

    @property
    def truth(self) -> frozenset[str]:
        """Names of the hidden effects."""
        return frozenset(self.case.hidden) if self.case.kind != "outside" else frozenset()

    @property
    def right(self) -> bool:
        """Whether the verdict is what the case's kind asks for.

        Exactly what is hidden as found; of what lies outside the catalogue no single cause; of
        look-alikes the truth first or in an ambiguous set; of a modulus alone that it cannot be
        told, or where it could be, its name.
        """
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
        """Whether exactly what is hidden is named, and as found."""
        return self.verdict == "found" and set(self.named) == self.truth

    @property
    def first(self) -> bool:
        """Whether the first that is named is hidden."""
        return bool(self.named) and self.named[0] in self.truth

    @property
    def inside(self) -> bool:
        """Whether all that is hidden is among what is named."""
        return bool(self.truth) and self.truth <= set(self.named)

    @property
    def false_name(self) -> bool:
        """Whether something is named that is not there. Rivals of an ambiguous verdict are none, if
        the truth is one of them.
        """
        if self.verdict == "ambiguous" and (self.inside or self.outside):
            return False
        return bool(set(self.named) - self.truth)

    @property
    def modulus_not_identifiable(self) -> bool:
        """Whether the report says that Young's modulus cannot be told."""
        return any(row["effect"] == MODULUS for row in self.report.get("not_identifiable", []))

    @property
    def removed(self) -> float | None:
        """Share [1] of the reducible error that what is named removes on test sequences."""
        value = ((self.report.get("gain") or {}).get("reducible_removed") or {}).get("value")
        return None if value is None else float(value)

    @property
    def gain(self) -> float:
        """Of the named causes, or the largest of those not named [nats]."""
        gains = [row.get("gain_nats", 0.0) for row in self.report.get("ranking", [])]
        return (
            float(self.report["evidence"]["gain_nats"] if self.causes else max(gains, default=0.0))
            if self.report
            else 0.0
        )

    @property
    def bound(self) -> float:
        """The least gain that is named [nats]."""
        return float(self.report["evidence"]["bound_nats"]) if self.report else 0.0

    @property
    def level(self) -> float:
        """Of the report's parameter intervals [1]."""
        return float(self.report.get("interval_level", STATED_LEVEL))

    @property
    def probabilities(self) -> dict[str, float]:
        """What the report gives each effect that it weighs [1]."""
        return {
            row["effect"]: float(row["probability"])
            for row in (*self.causes, *self.report.get("ranking", []))
        }

    def to_json(self) -> dict[str, Any]:
        """Plain values: one row of the file."""
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
        """The inverse."""
        return cls(**{**data, "case": Case.from_json(data["case"])})


def read_results(file: Path, mend: bool = False) -> list[CaseResult]:
    """All whole rows; a last one that is torn, as a kill while writing leaves it, does not count.
    `mend` cuts it off the file.

    RunError for any other row that is not a result.
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
    """One more row, on disk when this returns."""
    with file.open("a") as stream:
        stream.write(json.dumps(result.to_json()) + "\n")
        stream.flush()
        os.fsync(stream.fileno())


def _rewrite(file: Path, lines: Iterable[str]) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text("".join(line + "\n" for line in lines))
    os.replace(aside, file)
