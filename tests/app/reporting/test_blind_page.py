"""The page of the blind suite, from results made by hand."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser

from blind_results import cause, result

from palpate.app.reporting.blind_page import blind_page
from palpate.app.reporting.blind_tables import figure_text, hidden_text, named_text, target_text
from palpate.blind import CaseResult, summary_of
from palpate.blind.proportions import median_of, rate


def lump(name: str, off: float) -> CaseResult:
    named = cause("stiff_inclusion", 0.97, x=(0.01 + off, 0.009 + off, 0.011 + off))
    return result(
        "clear",
        "stiff_inclusion",
        "found",
        [named],
        name=name,
        truth={"x": 0.01},
        ranking={"gravity": 0.02},
        removed=0.9,
    )


RESULTS = [
    lump("clear-0", 2e-4),
    lump("clear-1", 5e-3),
    result("subtle", "gravity", name="subtle-0", ranking={"gravity": 0.3}, removed=0.0),
    result("control", name="control-0", ranking={"gravity": 0.1}),
    result("outside", "camera_drift", "unexplained", name="outside-0", ranking={"gravity": 0.1}),
    result("modulus", "young_modulus", name="modulus-0", ranking={"gravity": 0.1}),
    result(
        "pair",
        "gravity tool_radius",
        name="pair-0",
        error="diagnosing it: SolveError: <frame 3> & more",
    ),
]


class Tags(HTMLParser):
    """Every tag that is opened is closed; attributes that point elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str | None] = []
        self.rows = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [
            value
            for name, value in attrs
            if name in ("src", "href") or (name == "xlink:href" and value and value[0] != "#")
        ]
        self.rows += tag == "tr"
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_is_whole_and_needs_nothing_but_itself() -> None:
    page = blind_page(summary_of(RESULTS, 7), RESULTS)
    tags = Tags()
    tags.feed(page)
    assert tags.open == [] and tags.links == []
    assert "url(" not in page.replace("url(#", "")
    assert all(one.name in page for one in RESULTS)
    assert "1 cases ended in an error" in page and "&lt;frame 3&gt; &amp; more" in page


def test_plots_are_svg_in_the_pages_own_colours() -> None:
    page = blind_page(summary_of(RESULTS, 7), RESULTS)
    plots = [ET.fromstring(svg) for svg in re.findall(r"<svg.*?</svg>", page, re.S)]
    assert len(plots) == 3
    text = page[page.index("<svg") :]
    assert "var(--extended)" in text and "var(--measured)" in text
    assert not re.search(r"#0[1-6]0[1-6]0[1-6]", text)
    assert "--extended: #0d9488" in page and "prefers-color-scheme: dark" in page


def test_page_of_no_results_says_so_and_draws_what_it_can() -> None:
    page = blind_page(summary_of([], 7, missing=3), [])
    assert "3 cases have no result yet" in page and page.count("no cases") > 5


def test_versions_that_are_mixed_are_told() -> None:
    mixed = [RESULTS[0], replace(RESULTS[1], code="def")]
    assert "1 by abc, 1 by def" in blind_page(summary_of(mixed, 7), mixed)
    assert "several versions" not in blind_page(summary_of(RESULTS, 7), RESULTS)


def test_figures_are_said_as_people_read_them() -> None:
    assert figure_text(rate(1, 50).to_json()) == (
        "2\N{NO-BREAK SPACE}% (1 of 50)",
        "0.1\N{NO-BREAK SPACE}% to 10.6\N{NO-BREAK SPACE}%",
    )
    assert (
        figure_text(median_of([2e-4] * 9).to_json(), "m")[0] == "0.20\N{NO-BREAK SPACE}mm (9 cases)"
    )
    assert figure_text(rate(0, 0).to_json()) == ("–", "")
    targets = {
        row["key"]: target_text(row).replace("\N{NO-BREAK SPACE}", " ")
        for row in summary_of([], 0)["targets"]
    }
    assert targets["clear.first"] == "at least 95 %" and targets["coverage"] == "85 to 95 %"
    assert (
        targets["inclusion.plane"] == "at most 2.5 mm" and targets["camera.turn"] == "at most 0.30°"
    )
    assert targets["poisson_ratio"] == "at most 0.020"


def test_what_is_hidden_and_named_is_said_in_words() -> None:
    assert hidden_text(RESULTS[0]) == "stiff_inclusion: x 10.0\N{NO-BREAK SPACE}mm"
    assert [hidden_text(one) for one in RESULTS[3:5]] == ["nothing", "camera_drift"]
    assert named_text(RESULTS[3]) == "–" and named_text(RESULTS[-1]).startswith(
        "diagnosing it: SolveError"
    )
