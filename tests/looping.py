"""What a run of the whole loop leaves, for its tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from palpate.blind import Case, CaseResult, run_case

__all__ = ["LATE_CLOCK", "Loop", "run_looked_at"]

LATE_CLOCK = 14
"""Draws a camera clock that is 164 ms late: so much that the frames are grouped anew by it, and
searched again."""


def run_looked_at(case: Case, folder: Path, kept: Path) -> CaseResult:
    """As `run_case`; only where something is hidden does the run stay, with all that the page
    shows.
    """
    return run_case(case, folder, kept=None if case.kind == "control" else kept)


@dataclass(frozen=True)
class Loop:
    """The suite's folder, its results (an effect drawn, nothing hidden), and the run folder of the
    first.
    """

    seed: int
    suite: Path
    found: CaseResult
    nothing: CaseResult
    run: Path

    @property
    def report(self) -> dict[str, Any]:
        return self.found.report
