"""Causes in stored blind suites that leave significant structured error.

    python -m benchmarks.rejected_causes FILE ...

For every row with such a cause the table has the structured error with and without it, the share of
the reducible error that it removes on test sequences, and whether
`palpate.diagnosis.validation.rejection` rejects it today.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from palpate.blind.case_results import CaseResult, read_results
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.validation.rejection import leaves_structure

__all__ = ["run", "structures"]


def structures(result: CaseResult) -> tuple[Structure, Structure]:
    """Return the structured error over its chance level, without and with the named causes."""
    stated, left = result.report["evidence"], result.report["unexplained"]
    before, after = (
        Structure(one["structure"], 1.0, one["structure_bound"]) for one in (stated, left)
    )
    return before, after


def run(console: Console, files: Sequence[Path]) -> None:
    """Print a table of all files."""
    rows = [(file, one) for file in files for one in read_results(file) if one.causes]
    table = Table(
        title=f"{len(rows)} rows that name a cause; those that leave significant structure"
    )
    for name in ("file", "case", "named", "right", "without", "with", "removed", "rejected"):
        table.add_column(name)
    for file, one in rows:
        before, left = structures(one)
        if left.significant:
            table.add_row(
                file.name,
                one.name,
                ", ".join(one.named),
                "yes" if one.right else "no",
                f"{before.ratio:.2f}",
                f"{left.ratio:.2f}",
                "–" if one.removed is None else f"{100 * one.removed:.0f} %",
                "yes" if leaves_structure(before, left, one.removed) else "no",
            )
    console.print(table)


if __name__ == "__main__":
    run(Console(width=140), [Path(name) for name in sys.argv[1:]])
