"""Fast, picklable replacements of `run_case`."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from palpate.blind import Case, CaseResult
from palpate.foundation.source_digest import source_digest

NOTHING: dict[str, Any] = {
    "verdict": "none",
    "causes": [],
    "ranking": [],
    "not_identifiable": [],
    "gain": None,
    "evidence": {"gain_nats": 0.0, "bound_nats": 25.0},
}


def finish(case: Case, folder: Path) -> CaseResult:
    """A case in which nothing is found."""
    return CaseResult(case, report=NOTHING, code=source_digest())


def finish_or_die(case: Case, folder: Path) -> CaseResult:
    """Ends its own process as one without memory is ended, if its name says so."""
    if "dies" in case.name:
        os.kill(os.getpid(), signal.SIGKILL)
    return finish(case, folder)


def finish_or_wait(case: Case, folder: Path) -> CaseResult:
    """Waits for a minute, if its name says so, and leaves its process number beside the folder;
    others end once it does.
    """
    note = folder.parent / "waits.pid"
    if "waits" in case.name:
        note.with_suffix(".part").write_text(str(os.getpid()))
        note.with_suffix(".part").rename(note)
        time.sleep(60.0)
    while not note.exists():
        time.sleep(0.01)
    return finish(case, folder)
