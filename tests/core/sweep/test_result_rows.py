"""Result rows of a sweep on disk."""

from __future__ import annotations

from pathlib import Path

from palpate.sweep.result_rows import ResultRows


def test_incomplete_last_row_is_ignored(tmp_path: Path) -> None:
    stored = ResultRows(tmp_path / "rows")
    stored.start([])
    stored.add({"number": 0})
    with (tmp_path / "rows").open("a") as stream:
        stream.write('{"num')
    assert stored.read() == [{"number": 0}]
