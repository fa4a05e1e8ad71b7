"""`palpate export`: the report as one file."""

from __future__ import annotations

from typing import Any

import pytest
from typer.testing import CliRunner

from palpate.app.cli import app
from palpate.app.reporting.report_page import report_page
from palpate.app.storage.run_store import Run
from palpate.foundation.errors import RunError


@pytest.fixture
def run(place: Any, run_name: str) -> Run:
    return Run(place.runs / run_name)


def test_export_writes_the_page(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(run.path.parent)
    result = CliRunner().invoke(app, ["export", run.name])
    assert result.exit_code == 0, result.output
    assert (run.path.parent / f"{run.name}.html").read_text() == report_page(run)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["elsewhere"], "has no report.json"),
        ([".", "--out", "x.pdf"], "name such a file"),
        ([".", "--out", "no/x.html"], "cannot be"),
    ],
)
def test_export_says_what_is_wrong(
    run: Run, arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(run.path)
    with pytest.raises(RunError, match=message):
        CliRunner().invoke(app, ["export", *arguments], catch_exceptions=False)
