"""The report as one file: complete, self-contained, and harmless whatever a dataset is called."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from typing import Any

import httpx
import pytest

from palpate.app.reporting.report_page import report_page
from palpate.app.reporting.report_tables import ladder_steps, removed_share
from palpate.app.storage.run_store import Run


class Seen(HTMLParser):
    """Headings, and everything that would be fetched."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.fetched: list[str] = []
        self.tags: set[str] = set()
        self._heading = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self._heading = tag == "h2"
        self.fetched += [
            value
            for name, value in attrs
            if name in ("src", "href") and value and not value.startswith(("data:", "#"))
        ]

    def handle_data(self, data: str) -> None:
        if self._heading:
            self.headings.append(data)
            self._heading = False


@pytest.fixture
def run(place: Any, run_name: str) -> Run:
    return Run(place.runs / run_name)


def changed(run: Run, **values: Any) -> Run:
    (run.path / "report.json").write_text(json.dumps({**run.report, **values}))
    return Run(run.path)


def test_page_has_every_part_of_the_report_and_fetches_nothing(run: Run) -> None:
    text = report_page(run)
    seen = Seen(text)
    assert seen.headings == [
        "Cause",
        "Error on sequences not fitted on",
        "Every sequence",
        "The error and its explanation",
        "Ranking",
        "What this data can tell",
        "Controls",
        "What to measure next",
        "Cannot be told from this data",
        "How this was made",
    ]
    assert seen.fetched == [] and "script" not in seen.tags
    assert re.findall(r"url\((?!#)", text) == [] and "@import" not in text
    assert "The simulation misses a stiff lump" in text
    assert re.search(r"radius</td><td><b>7\.5.mm</b></td><td>7\.0.mm to 8\.0.mm", text)
    assert re.search(r"<b>drag-01</b></td><td>test</td>", text)
    assert "press 6 mm deep on the top" in text.lower()


def test_page_without_a_cause_says_so(run: Run) -> None:
    text = report_page(
        changed(run, verdict="none", causes=[], warnings=["12 of 300 clouds were unreadable"])
    )
    assert "The simulation misses nothing" in text and "No cause was named" in text
    assert "Cause</h2>" not in text and "12 of 300 clouds" in text


def test_what_a_dataset_says_is_never_markup(run: Run) -> None:
    evil = "<script>alert(1)</script>"
    text = report_page(
        changed(
            run,
            dataset=evil,
            warnings=[evil],
            not_identifiable=[{"effect": evil, "why": evil, "measure_instead": evil}],
        )
    )
    assert "<script>" not in text and "&lt;script&gt;" in text


def test_bars_are_as_long_as_the_errors() -> None:
    gain = {"unit": "mm", "baseline": 0.4, "extended": 0.3, "noise_floor": 0.1}
    lengths = [step.percent for step in ladder_steps(gain, named=True)]
    assert lengths == pytest.approx([100.0, 75.0, 25.0])
    assert [step.percent for step in ladder_steps(gain, named=False)] == [100.0, 25.0]
    assert ladder_steps({}, named=True) == []


def test_tuning_alone_is_told_beside_the_gain(run: Run) -> None:
    gain = {
        "baseline": 0.4,
        "extended": 0.3,
        "reducible_removed": {"value": 0.5, "low": 0.4, "high": 0.6},
        "tuned": {"value": 0.12},
    }
    removed = removed_share(gain, named=True)
    assert removed is not None
    text = removed.text.replace("\N{NO-BREAK SPACE}", " ")
    assert removed.share.startswith("50") and "(40 % to 60 %)" in text and "Of that, 12 %" in text
    page = report_page(changed(run, gain=gain)).replace("\N{NO-BREAK SPACE}", " ")
    assert "50 %</b> (40 % to 60 %)" in page


def test_page_over_rest_is_a_download(client: httpx.Client, run_name: str) -> None:
    answer = client.get(f"/api/runs/{run_name}/report.html")
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["content-disposition"] == f'attachment; filename="{run_name}.html"'
    assert answer.text.startswith("<!doctype html>")
    assert client.get("/api/runs/nothing/report.html").status_code == 404
