"""A suite on disk: taken up again, never mixed silently, and nothing left behind."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import blind_processes
import pytest
from blind_results import result

import palpate
from palpate.blind import Case, run_suite
from palpate.blind.case_results import add_result
from palpate.foundation.errors import Cancelled, RunError
from palpate.foundation.source_digest import EXCLUDED, source_digest

TESTS = Path(blind_processes.__file__).parent


def control(name: str) -> Case:
    return Case(name, 1, "control")


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    cases = [control("a"), control("b")]
    first = run_suite(tmp_path, cases, workers=2, run=blind_processes.finish)
    assert [one.name for one in first] == ["a", "b"] and all(one.right for one in first)
    reports: list[Any] = []
    again = run_suite(
        tmp_path,
        cases[::-1],
        workers=2,
        report=lambda fraction, text: reports.append((fraction, text)),
    )
    assert again == first[::-1]
    assert reports == [(1.0, "2 of 2 were there already")]
    assert [path.name for path in tmp_path.iterdir()] == ["results.jsonl"]


def test_case_that_raises_is_a_result_with_its_error(tmp_path: Path) -> None:
    strange = Case("strange", 1, "clear", ("moon",))
    (one,) = run_suite(tmp_path, [strange], workers=1)
    assert one.error.startswith(
        "making the dataset: EffectError: the virtual bench cannot hide 'moon'"
    )
    assert not one.right


def test_row_that_was_torn_is_done_again(tmp_path: Path) -> None:
    run_suite(tmp_path, [control("a")], workers=1, run=blind_processes.finish)
    file = tmp_path / "results.jsonl"
    file.write_text(file.read_text() + file.read_text()[:60])
    found = run_suite(tmp_path, [control("a"), control("b")], workers=1, run=blind_processes.finish)
    assert [one.name for one in found] == ["a", "b"]
    assert [json.loads(line)["case"]["name"] for line in file.read_text().splitlines()] == [
        "a",
        "b",
    ]


def test_process_that_dies_takes_no_other_along(tmp_path: Path) -> None:
    cases = [control("dies"), *(control(name) for name in "abc")]
    found = run_suite(tmp_path, cases, workers=2, run=blind_processes.finish_or_die)
    assert "ended from outside" in found[0].error
    assert [one.error for one in found[1:]] == ["", "", ""]


def test_errors_are_done_again_only_where_that_is_asked_for(tmp_path: Path) -> None:
    add_result(
        tmp_path / "results.jsonl",
        replace(result("control", error="out of memory"), case=control("a"), code=source_digest()),
    )
    assert run_suite(tmp_path, [control("a")], workers=1)[0].error == "out of memory"
    assert (
        run_suite(tmp_path, [control("a")], workers=1, again=True, run=blind_processes.finish)[
            0
        ].error
        == ""
    )
    assert run_suite(tmp_path, [control("a")], workers=1, again=True)[0].error == ""


def test_result_of_another_version_is_taken_only_where_that_is_allowed(tmp_path: Path) -> None:
    add_result(tmp_path / "results.jsonl", result("control", name="a"))
    with pytest.raises(
        RunError, match=f"a was made by version abc of the code, this is {source_digest()}"
    ):
        run_suite(tmp_path, [Case("a", 0, "control")], workers=1)
    assert (
        run_suite(tmp_path, [Case("a", 0, "control")], workers=1, any_version=True)[0].code == "abc"
    )


def test_result_of_another_case_of_that_name_is_an_error(tmp_path: Path) -> None:
    add_result(tmp_path / "results.jsonl", result("control", name="a"))
    with pytest.raises(RunError, match=r"a was .*seed=0.* now it is .*seed=1"):
        run_suite(tmp_path, [control("a")], workers=1, any_version=True)


def test_results_of_other_cases_stay_in_the_file_and_out_of_the_suite(tmp_path: Path) -> None:
    add_result(tmp_path / "results.jsonl", result("control", name="other"))
    assert [
        one.name
        for one in run_suite(tmp_path, [control("a")], workers=1, run=blind_processes.finish)
    ] == ["a"]
    rows = [json.loads(line) for line in (tmp_path / "results.jsonl").read_text().splitlines()]
    assert [row["case"]["name"] for row in rows] == ["other", "a"]


def test_stopped_suite_keeps_what_is_done_and_leaves_no_process_behind(tmp_path: Path) -> None:
    def stop(fraction: float, text: str) -> None:
        if text.startswith("a:"):
            raise Cancelled

    with pytest.raises(Cancelled):
        run_suite(
            tmp_path,
            [control("waits"), control("a")],
            workers=2,
            report=stop,
            run=blind_processes.finish_or_wait,
        )
    waiting = int((tmp_path / "waits.pid").read_text())
    assert _gone(waiting)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results.jsonl", "waits.pid"]
    assert len((tmp_path / "results.jsonl").read_text().splitlines()) == 1


def test_suite_that_is_killed_leaves_no_process_behind(tmp_path: Path) -> None:
    suite = (
        "from pathlib import Path; import sys, blind_processes; from palpate.blind import Case, "
        "run_suite\n"
        "if __name__ == '__main__':\n"
        "    run_suite(Path(sys.argv[1]), [Case('waits', 1, 'control')], 1, "
        "run=blind_processes.finish_or_wait)\n"
    )
    (tmp_path / "suite.py").write_text(suite)
    searched = os.pathsep.join(str(path) for path in (TESTS, TESTS.parent))
    with subprocess.Popen(
        [sys.executable, tmp_path / "suite.py", tmp_path], env=os.environ | {"PYTHONPATH": searched}
    ) as started:
        while not (tmp_path / "waits.pid").exists():
            assert started.poll() is None
            time.sleep(0.05)
        started.kill()
    assert _gone(int((tmp_path / "waits.pid").read_text()))


def _gone(pid: int) -> bool:
    """Whether a process ends within some seconds: it may still be waiting for its parent to take
    notice.
    """
    for _ in range(500):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def test_sources_of_a_result_import_nothing_that_its_digest_leaves_out() -> None:
    names = "|".join(name.removesuffix(".py").replace("/", r"\.") for name in EXCLUDED)
    using = re.compile(rf"^\s*(from|import) palpate\.({names})\b", re.MULTILINE)
    root = Path(palpate.__file__).parent
    parts = [
        path
        for path in root.rglob("*.py")
        if not path.relative_to(root).as_posix().startswith(EXCLUDED)
    ]
    assert len(parts) > 100 and [path for path in parts if using.search(path.read_text())] == []
