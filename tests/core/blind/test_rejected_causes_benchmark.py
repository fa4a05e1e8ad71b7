"""The benchmark of the rule that rejects a cause which leaves most of the error, on stored rows."""

from __future__ import annotations

import io
import json
from pathlib import Path

from rich.console import Console

from benchmarks.rejected_causes import run

KEPT = Path(__file__).parents[3] / "benchmarks" / "blind"


def _printed(name: str) -> list[str]:
    page = Console(file=io.StringIO(), width=300)
    run(page, [KEPT / name])
    assert isinstance(page.file, io.StringIO)
    return page.file.getvalue().splitlines()


def _of(lines: list[str], case: str) -> str:
    (line,) = [line for line in lines if case in line]
    return line


def test_cause_in_place_of_a_second_body_is_rejected() -> None:
    line = _of(_printed("suite-1400-replaced.jsonl"), "outside-1400-004-second_body")
    cells = [cell.strip() for cell in line.split("│")]
    assert cells[3:9] == ["stiff_inclusion", "no", "2.21", "1.88", "29 %", "yes"]


def test_pair_that_leaves_a_hundredth_is_kept() -> None:
    line = _of(_printed("suite-1400-first.jsonl"), "pair-1400-000")
    assert [cell.strip() for cell in line.split("│")][4:9] == ["yes", "76.40", "1.88", "95 %", "no"]


def test_rows_that_leave_nothing_significant_are_only_counted() -> None:
    name = "suite-1400-replaced.jsonl"  # it grows with each row of the suite that is done again
    reports = [json.loads(line)["report"] for line in (KEPT / name).read_text().splitlines()]
    lines = _printed(name)
    assert f"{sum(bool(one['causes']) for one in reports)} rows that name a cause" in lines[0]
    assert sum(line.startswith("│") for line in lines) == 2
