"""What a run of the whole loop leaves, for its tests."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from core.blind import Case, Result, draw_cases, run_case, run_suite

__all__ = ["LATE_CLOCK", "SLIPPING_BASE", "Loop", "looped", "seed_or"]

SLIPPING_BASE = 1
"""Draws a base that slips: one of the causes that take the least time."""
LATE_CLOCK = 14
"""Draws a camera clock that is 164 ms late: so much that the frames are grouped anew by it, and searched again."""


def seed_or(usual: int) -> int:
    """The seed that was asked for, or the usual one."""
    return int(os.environ.get("PALPATE_SEED", usual))


def _run_looked_at(case: Case, folder: Path, kept: Path) -> Result:
    """As `run_case`; only where something is hidden does the run stay, with all that the page shows."""
    return run_case(case, folder, kept=None if case.kind == "control" else kept)


@dataclass(frozen=True)
class Loop:
    """The suite's folder, the result where an effect was drawn, and its run folder."""

    seed: int
    suite: Path
    found: Result
    run: Path

    @property
    def report(self) -> dict[str, Any]:
        return self.found.report


def looped(folder: Path, seed: int, others: Sequence[Case] = ()) -> tuple[Loop, list[Result]]:
    """The clear case that `seed` draws, made and diagnosed into `folder`, and beside it the results of the `others`."""
    fresh = draw_cases(seed, 1, kinds=["clear"], short=True)
    print(f"seed {seed}: {fresh}")  # noqa: T201 (what was drawn, should it fail)
    suite, kept = folder / "suite", folder / "kept"
    found, *rest = run_suite(suite, [*fresh, *others], workers=2, run=partial(_run_looked_at, kept=kept))
    assert not found.error, f"seed {seed}: {found.error}"
    return Loop(seed, suite, found, kept / "runs" / found.name), rest
