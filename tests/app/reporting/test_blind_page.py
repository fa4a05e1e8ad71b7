"""The blind suite in terminal and page, from results made by hand."""

from __future__ import annotations

import json
import re
import signal
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from blind_results import cause, result

from palpate.app.cli import main
from palpate.app.reporting.blind_page import blind_page
from palpate.app.reporting.blind_tables import figure_text, hidden_text, named_text, target_text
from palpate.blind import CaseResult, all_cases, draw_cases, summary_of
from palpate.blind.case_results import add_result
from palpate.blind.proportions import median_of, rate
from palpate.foundation.source_digest import source_digest


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


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(sys, "argv", ["palpate", "blind", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    signal.signal(signal.SIGTERM, before)
    return int(end.value.code or 0)


def test_suite_that_is_done_is_scored_and_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for case in [one for one in all_cases(4, controls=3) if one.kind == "control"]:
        add_result(tmp_path / "results.jsonl", replace(RESULTS[3], case=case, code=source_digest()))
    assert (
        run(
            monkeypatch,
            "--folder",
            str(tmp_path),
            "--seed",
            "4",
            "--controls",
            "3",
            "--only",
            "control",
        )
        == 0
    )
    assert "nothing hidden: 3 of 3 right, a cause falsely named in 0" in capsys.readouterr().out
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["seed"], summary["cases"], summary["kinds"]["control"]["right"]["hits"]) == (
        4,
        3,
        3,
    )
    assert "3 of 3 cases right" in (tmp_path / "report.html").read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "report.html",
        "results.jsonl",
        "summary.json",
    ]


def test_where_cases_are_kept_it_is_said_how_to_look_at_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    case = draw_cases(4, 3)[0]
    add_result(tmp_path / "results.jsonl", replace(RESULTS[3], case=case, code=source_digest()))
    score = ("--folder", str(tmp_path), "--seed", "4", "--scenarios", "3", "--score")
    assert run(monkeypatch, *score) == 0 and "to look at it" not in capsys.readouterr().out
    (tmp_path / "kept").mkdir()
    assert run(monkeypatch, *score) == 0
    assert (
        f"serve --runs {tmp_path / 'kept' / 'runs'} --datasets {tmp_path / 'kept' / 'datasets'}"
        in capsys.readouterr().out
    )


def test_suite_that_still_runs_is_scored_as_far_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = draw_cases(4, 3)[0]
    add_result(tmp_path / "results.jsonl", replace(RESULTS[3], case=case, code=source_digest()))
    torn = (tmp_path / "results.jsonl").read_text() + '{"case": '
    (tmp_path / "results.jsonl").write_text(torn)
    assert (
        run(monkeypatch, "--folder", str(tmp_path), "--seed", "4", "--scenarios", "3", "--score")
        == 0
    )
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["cases"], summary["missing"]) == (1, 2)
    assert (tmp_path / "results.jsonl").read_text() == torn


def test_results_of_other_cases_are_not_scored_as_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ("--folder", str(tmp_path), "--seed", "4", "--scenarios", "3", "--score")
    assert run(monkeypatch, *asked) == 2
    assert "holds no results.jsonl with results to score" in capsys.readouterr().err.replace(
        "\n", " "
    )
    add_result(
        tmp_path / "results.jsonl",
        replace(RESULTS[3], case=draw_cases(5, 3)[0], code=source_digest()),
    )
    assert run(monkeypatch, *asked) == 2
    assert "none of its 1 results is of these 3 cases" in capsys.readouterr().err.replace("\n", " ")
    assert [path.name for path in tmp_path.iterdir()] == ["results.jsonl"]


def test_drawn_suite_takes_kinds_and_effects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for case in draw_cases(4, 4, kinds=["clear"], effects=["gravity"]):
        add_result(
            tmp_path / "results.jsonl",
            replace(result("clear", "gravity", "found", [cause("gravity")]), case=case, code="abc"),
        )
    asked = [
        "--folder",
        str(tmp_path),
        "--seed",
        "4",
        "--scenarios",
        "4",
        "--kinds",
        "clear",
        "--effects",
        "gravity",
    ]
    assert run(monkeypatch, *asked) == 2
    assert "was made by version abc of the code" in capsys.readouterr().err.replace("\n", " ")
    assert run(monkeypatch, *asked, "--any-version") == 0
    assert "one effect, clear: 4 of 4 right" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ("--kinds", "clear"),
        ("--scenarios", "5", "--kinds", "moon"),
        ("--effects", "moon"),
        ("--scenarios", "0"),
    ],
)
def test_what_cannot_be_asked_for_is_exit_code_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    assert run(monkeypatch, "--folder", str(tmp_path / "none"), *arguments) == 2
    assert not (tmp_path / "none").exists()
