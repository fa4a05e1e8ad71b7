from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from broken_datasets import BREAKAGES, REPRESENTATIVE, write_valid_dataset

from palpate.app.cli import main
from palpate.app.commands import console
from palpate.app.commands.console import agrees, progress, verdict_cells, verdict_table, write_json
from palpate.app.commands.diagnosis import print_report
from palpate.app.jobs.signals import Stop
from palpate.dataset.provenance import dataset_digest
from palpate.foundation.errors import Cancelled
from palpate.foundation.quantities import parameters_text

Palpate = Callable[..., tuple[int, str, str]]


@pytest.fixture
def palpate(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Palpate:
    """Run a verb in this process: exit code, output and errors."""
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(console.out, "width", 200)

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["palpate", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        signal.signal(signal.SIGTERM, before)
        text = capsys.readouterr()
        return int(end.value.code or 0), text.out, text.err

    return run


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return write_valid_dataset(tmp_path / "data" / "small")


def files(folder: Path) -> dict[str, int]:
    return {str(path): path.lstat().st_mtime_ns for path in folder.rglob("*")}


def test_help_names_every_verb(palpate: Palpate) -> None:
    code, out, _ = palpate("--help")
    assert code == 0
    assert all(
        verb in out
        for verb in ("demo", "check", "register", "replay", "diagnose", "blind", "serve")
    )


@pytest.mark.parametrize(
    "arguments",
    [("nonsense",), ("check",), ("diagnose", "x", "--workers", "0"), ("serve", "--port", "99999")],
)
def test_wrong_arguments_are_exit_code_2(palpate: Palpate, arguments: tuple[str, ...]) -> None:
    assert palpate(*arguments)[0] == 2


@pytest.mark.parametrize("kind", REPRESENTATIVE)
def test_broken_dataset_is_one_clear_message_and_exit_code_2(
    palpate: Palpate, dataset: Path, kind: str
) -> None:
    BREAKAGES[kind](dataset)
    before = files(dataset.parent)
    for verb in ("check", "diagnose"):
        code, out, err = palpate(verb, dataset)
        assert (code, out) == (2, "")
        lines = [line for line in err.splitlines() if "Error" in line]
        assert len(lines) == 1
        assert "Traceback" not in err
        assert all(word in err for word in BREAKAGES[kind].says)
    assert files(dataset.parent) == before


def test_check_goes_on_after_a_broken_dataset_and_says_so_in_the_end(
    palpate: Palpate, dataset: Path, tmp_path: Path
) -> None:
    code, out, err = palpate("check", tmp_path / "nothing", dataset)
    assert code == 2
    assert "nothing does not exist" in err
    assert "small-block" in out
    assert "poke-01" in out
    assert "forces in 1 of 2 sequences, so that Young's modulus can be found" in out


def test_check_prints_the_digests_on_demand(palpate: Palpate, dataset: Path) -> None:
    code, out, _ = palpate("check", dataset, "--digest")
    assert code == 0
    assert f"digest {dataset_digest(dataset)}, of all bytes" in out
    assert dataset_digest(dataset, full=True) in out


def test_two_datasets_of_one_name_are_refused_before_any_computing(
    palpate: Palpate, dataset: Path, tmp_path: Path
) -> None:
    code, _, err = palpate("diagnose", dataset, write_valid_dataset(tmp_path / "other" / "small"))
    assert code == 2
    assert "same folder name" in err


def test_run_folder_that_exists_is_not_overwritten(
    palpate: Palpate, dataset: Path, tmp_path: Path
) -> None:
    (tmp_path / "run").mkdir()
    code, _, err = palpate("diagnose", dataset, "--run", tmp_path / "run")
    assert code == 2
    assert "exists already" in err
    assert list((tmp_path / "run").iterdir()) == []


@pytest.mark.parametrize("verb", ["diagnose", "evaluate", "replay", "export"])
def test_result_that_a_folder_is_in_the_way_of_is_refused_before_any_computing(
    palpate: Palpate, dataset: Path, tmp_path: Path, verb: str
) -> None:
    (tmp_path / "there").mkdir()
    code, _, err = palpate(verb, dataset, "--out", tmp_path / "there")
    assert (
        code == 2
        and re.search("is a (folder|directory)", re.sub(r"[\s│]+", " ", err))
        and "Traceback" not in err
    )
    assert not list((tmp_path / "there").iterdir())


def test_reports_of_several_datasets_need_a_folder_and_one_no_run_folder(
    palpate: Palpate, dataset: Path, tmp_path: Path
) -> None:
    (tmp_path / "there.json").write_text("{}")
    code, _, err = palpate(
        "diagnose",
        dataset,
        write_valid_dataset(tmp_path / "more"),
        "--out",
        tmp_path / "there.json",
    )
    assert code == 2 and "is a file; of several datasets it is a folder" in re.sub(
        r"[\s│]+", " ", err
    )
    code, _, err = palpate(
        "diagnose", dataset, "--out", tmp_path / "new", "--run", tmp_path / "new"
    )
    assert code == 2 and "--out and --run are both" in err and not (tmp_path / "new").exists()
    assert (tmp_path / "there.json").read_text() == "{}"


def test_serve_refuses_a_token_that_others_may_read(palpate: Any, tmp_path: Path) -> None:
    (tmp_path / "login.json").write_text('{"salt": "00", "scrypt": "00"}')
    (tmp_path / "login.json").chmod(0o644)
    code, _, err = palpate("serve", "--host", "0.0.0.0", "--port", "0", "--runs", str(tmp_path))
    assert code != 0
    assert "others may read it" in err.replace("\n", " ")


@pytest.mark.parametrize(
    ("grid", "told"),
    [(["--grid", "7x5x4"], "7x5x4 nodes"), ([], "follows the tool")],
    ids=["even", "graded"],
)
def test_replay_writes_one_equilibrium_per_cloud(
    palpate: Palpate, dataset: Path, tmp_path: Path, grid: list[str], told: str
) -> None:
    code, out, err = palpate(
        "replay", dataset, "--sequence", "poke-01", *grid, "--out", tmp_path / "frames.npz"
    )
    assert code == 0, err
    assert told in out
    assert "5 converged" in out
    assert "the grid's own error, by a finer one" in out
    with (tmp_path / "frames.npz").open("rb") as stream, np.load(stream) as frames:
        assert frames["vertices"].shape == (5, len(frames["rest"]), 3)
        lowest = (frames["vertices"] - frames["rest"])[..., 2].min(axis=1)
        assert lowest[2] < -1e-3
        assert lowest[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [("--grid", "13x5", "13x5x5"), ("--sequence", "poke-99", "no such sequence")],
)
def test_replay_tells_what_it_cannot_replay(
    palpate: Palpate, dataset: Path, tmp_path: Path, option: str, value: str, words: str
) -> None:
    code, _, err = palpate(
        "replay", dataset, "--sequence", "poke-01", "--out", tmp_path / "frames.npz", option, value
    )
    assert code == 2
    assert words in err
    assert not (tmp_path / "frames.npz").exists()


def test_stop_that_an_import_swallowed_is_remembered() -> None:
    stop = Stop()
    with contextlib.suppress(KeyboardInterrupt):
        stop(signal.SIGINT, None)
    assert stop.received
    with (
        pytest.MonkeyPatch.context() as patch,
        pytest.raises(Cancelled),
        progress("a long verb") as report,
    ):
        patch.setattr("palpate.app.commands.console.stop", stop)
        report(0.5, "going on")


def test_log_gets_a_line_of_progress_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("a long verb") as report:
        report(0.1, "not yet")
        monkeypatch.setattr("palpate.app.commands.console.BETWEEN_LINES", 0.0)
        report(0.5, "fitting [one] effect")
    assert re.fullmatch(
        r"a long verb: 50 % after \d+ s, fitting \[one\] effect\n", capsys.readouterr().err
    )


def _wait_until_at_work(process: subprocess.Popen[str], seconds: float) -> None:
    """Until it has used that much of a core [s], however busy the machine is."""
    used = 0.0
    while used < seconds and process.poll() is None:
        time.sleep(0.1)
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        used = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_verb_ends_with_130_and_leaves_nothing(
    dataset: Path, tmp_path: Path, number: signal.Signals
) -> None:
    for index in range(400):
        name = f"{index + 5:06d}.ply"
        (dataset / "sequences" / "poke-01" / "clouds" / name).write_bytes(
            (dataset / "rest.ply").read_bytes()
        )
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [
        sys.executable,
        "-m",
        "palpate.app.cli",
        "replay",
        str(dataset),
        "--sequence",
        "poke-01",
        "--grid",
        "41x25x25",
        "--out",
    ]
    with subprocess.Popen(
        [*command, str(tmp_path / "frames.npz")], stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        _wait_until_at_work(process, seconds=6.0)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    # Python itself ends by SIGINT, which a shell shows as 130, too, when the stop fell into certain
    # parts of an import.
    assert process.returncode in (130, -signal.SIGINT)
    assert "nothing was left half done" in err
    assert not list(tmp_path.glob("*frames*"))


def test_served_page_ends_with_ctrl_c_though_somebody_is_listening(
    tmp_path: Path, place: Any
) -> None:
    command = [
        sys.executable,
        "-m",
        "palpate.app.cli",
        "serve",
        "--port",
        "0",
        "--runs",
        str(place.runs),
        "--datasets",
        str(place.datasets),
    ]
    environment = {**os.environ, "PALPATE_PRELOAD": "[]", "COLUMNS": "200"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stdout is not None
            address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            assert address is not None
            with (
                httpx.Client(base_url=address[0], timeout=30) as client,
                client.stream("GET", "/api/jobs/events") as events,
            ):
                assert next(events.iter_lines()) == "data: []"
                began = time.monotonic()
                process.send_signal(signal.SIGINT)
                process.wait(timeout=30)
        finally:
            process.kill()
    assert process.returncode == 0
    assert time.monotonic() - began < 15


def test_verdict_is_compared_with_the_truth_by_name(report: dict[str, Any]) -> None:
    lump = {"effect": "stiff_inclusion", "parameters": {"radius": {"value": 0.008, "unit": "m"}}}
    assert agrees(report, {"verdict": "found", "effects": [lump]})
    assert not agrees(report, {"verdict": "found", "effects": [{**lump, "effect": "gravity"}]})
    assert not agrees(report, {"verdict": "none", "effects": []})
    assert agrees({**report, "verdict": "none", "causes": []}, {"verdict": "none", "effects": []})


def test_table_of_verdicts_has_a_cell_for_every_column(report: dict[str, Any]) -> None:
    truth = {"verdict": "none", "effects": []}
    for with_truth in (False, True):
        cells = verdict_cells("small", report, 61.2, truth if with_truth else None, with_truth)
        assert len(cells) == len(verdict_table(with_truth).columns)
        assert "93 %\n(90 to 96)" in cells
    assert "radius 7.5\N{NO-BREAK SPACE}mm (7.0 to 8.0)" in parameters_text(report["causes"][0])


def test_json_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    write_json(tmp_path / "deep" / "report.json", {"a": 1})
    assert json.loads((tmp_path / "deep" / "report.json").read_text()) == {"a": 1}
    with pytest.raises(TypeError):
        write_json(tmp_path / "deep" / "report.json", {"a": object()})
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["report.json"]


def test_report_is_printed_with_what_the_data_can_tell(
    report: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.out, "width", 200)
    print_report(report)
    shown = capsys.readouterr().out.replace("\N{NO-BREAK SPACE}", " ")
    assert "What this data can tell" in shown
    assert "0.12 mm" in shown and "tool offset (83 %)" in shown and "1.4 times" in shown
    assert "nothing else" in shown and "(20 %)" not in shown


def test_report_is_printed_with_what_is_left_and_with_its_warnings(
    report: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.out, "width", 200)
    left = {"fraction": 0.3, "where": "all over rest.ply", "when": "always"}
    print_report(
        {
            **report,
            "verdict": "unexplained",
            "unexplained": left,
            "warnings": ["rest.ply: depth waves [by 0.2 mm]"],
        }
    )
    shown = (
        capsys.readouterr()
        .out.replace("\N{NO-BREAK SPACE}", " ")
        .replace("\N{NARROW NO-BREAK SPACE}", " ")
    )
    assert "30 % of the structured error is left. Where: all over rest.ply. When: always." in shown
    assert "warning rest.ply: depth waves [by 0.2 mm]" in shown


def test_report_is_printed_with_its_controls_and_the_next_probe(
    report: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.out, "width", 200)
    print_report(report)
    shown = capsys.readouterr().out.replace("\N{NO-BREAK SPACE}", " ")
    assert "control: with the clock shifted, stiff inclusion keeps 1 % of its gain at most" in shown
    assert (
        "next probe: press 6 mm deep on the top at (12, -8) mm" in shown and "calliper" not in shown
    )
