"""What a run of the whole loop leaves, for its tests."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.blind import Result

__all__ = ["LATE_CLOCK", "Loop"]

LATE_CLOCK = 14
"""Draws a camera clock that is 164 ms late."""


@dataclass(frozen=True)
class Loop:
    """The suite's folder, its results (an effect drawn, nothing hidden), and the run folder of the first."""

    seed: int
    suite: Path
    found: Result
    nothing: Result
    run: Path

    @property
    def report(self) -> dict[str, Any]:
        return self.found.report
