"""`palpate blind`, on results made by hand."""

from __future__ import annotations

import json
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from blind_results import cause, result

from palpate.app.cli import main
from palpate.blind import all_cases, draw_cases
from palpate.blind.case_results import add_result
from palpate.foundation.source_digest import source_digest

CONTROL = result("control", name="control-0", ranking={"gravity": 0.1})


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
        add_result(tmp_path / "results.jsonl", replace(CONTROL, case=case, code=source_digest()))
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
    add_result(tmp_path / "results.jsonl", replace(CONTROL, case=case, code=source_digest()))
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
    add_result(tmp_path / "results.jsonl", replace(CONTROL, case=case, code=source_digest()))
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
        tmp_path / "results.jsonl", replace(CONTROL, case=draw_cases(5, 3)[0], code=source_digest())
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


def test_suite_on_shapes_prints_how_far_lumps_and_tubes_were_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = [[-0.03, 0.0, 0.02], [0.03, 0.0, 0.02]]
    ball = result(
        "clear",
        "stiff_inclusion",
        "found",
        [cause("stiff_inclusion", 0.99, **dict.fromkeys("xyz", (0.002, 0.001, 0.003)))],
        truth={"x": 0.0, "y": 0.0, "z": 2e-3},
    )
    tube = result("clear", "stiff_tube", "found", [{**cause("stiff_tube"), "polyline": line[:1]}])
    tube = replace(tube, hidden=[{**tube.hidden[0], "polyline": line}])
    made = {("stiff_inclusion",): ball, ("stiff_tube",): tube, (): CONTROL}
    for case in draw_cases(4, 60, shapes=True):
        if case.hidden in made:
            known = replace(made[case.hidden], case=case, code=source_digest())
            add_result(tmp_path / "results.jsonl", known)
    options = ("--folder", str(tmp_path), "--seed", "4", "--shapes", "--scenarios", "60")
    assert run(monkeypatch, *options, "--score") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "nothing hidden: 15 of 15 right" in told and "one effect, clear: 6 of 6 right" in told
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["missing"] == 60 - 15 - 6
    targets = {one["key"]: one for one in summary["targets"]}
    centre, tubes = targets["shapes.inclusion.centre"], targets["shapes.tube.near"]
    assert (centre["reached"]["value"], centre["met"]) == (
        pytest.approx(8**0.5 * 1e-3, rel=1e-5),
        True,
    )
    assert (tubes["reached"]["hits"], tubes["reached"]["n"], tubes["met"]) == (0, 3, False)
    assert targets["shapes.inclusion.near"]["reached"]["hits"] == 3
    page = (tmp_path / "report.html").read_text()
    assert "On shapes, inclusion: error of its centre" in page and "2.8" in page
