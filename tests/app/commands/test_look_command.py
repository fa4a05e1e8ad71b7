"""`palpate look`: a summary, and the page on it."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from bench_recording import BenchRecording, bench_setup
from small_dataset import write_valid_dataset

from palpate.app.cli import main
from palpate.app.commands import console

Palpate = Callable[..., tuple[int, str, str]]


@pytest.fixture
def palpate(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Palpate:
    """Run a verb in this process, in an empty folder: exit code, output and errors."""
    monkeypatch.setattr(console.out, "width", 200)
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["palpate", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        text = capsys.readouterr()
        return int(end.value.code or 0), text.out, text.err

    return run


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    bench_setup(folder)
    BenchRecording(rate=50.0).write(folder / "bench.bag")
    return folder


def test_streams_sequences_and_doubts_are_printed_and_nothing_is_kept(
    palpate: Palpate, bench: Path, tmp_path: Path
) -> None:
    setup = bench / "dataset.toml"
    code, out, _ = palpate("look", bench / "bench.bag", "--setup", setup, "--no-serve")
    assert code == 0
    assert re.search(r"/PSM1/measured_cp +pose +2765 +50\.0 Hz +2\.0 ms", out)
    assert re.search(r"poke-top-02 +top +test +28\.83 s +34\.28 s", out)
    assert "decided touches.csv: dwells lie as the landmarks do" in out
    assert "warning forces are shown as recorded" in out
    assert list(tmp_path.iterdir()) == []


def test_a_dataset_has_a_row_for_each_sequence(palpate: Palpate, tmp_path: Path) -> None:
    write_valid_dataset(tmp_path / "block")
    code, out, _ = palpate("look", "block", "--no-serve")
    assert code == 0
    assert re.search(r"poke-01 +train +1\.0 s +5 +3\.0 mm", out)


def test_a_mapping_alone_names_its_recordings(palpate: Palpate, bench: Path) -> None:
    mapping = bench / "import.toml"
    assert palpate("import", bench / "bench.bag", "--mapping", mapping)[0] == 0
    code, out, _ = palpate("look", "--mapping", mapping, "--no-serve")
    assert code == 0 and "no phantom is stated" in out
    assert palpate("look")[0] == 2


def test_the_page_is_served_on_the_look(bench: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "palpate.app.cli", "look", str(bench / "bench.bag")]
    with subprocess.Popen(
        [*command, "--port", "0"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as served:
        try:
            assert served.stdout is not None
            lines = iter(served.stdout.readline, "")
            said = next(line for line in lines if line.startswith("Palpate is at"))
            found = re.search(r"(http://\S+)/\?look=(look-\S+)", said)
            assert found is not None
            answer = httpx.get(f"{found[1]}/api/looks/{found[2]}", timeout=60)
            look = answer.raise_for_status().json()
            assert look["source"]["name"] == "bench" and look["request"]["files"]
            assert len(look["recordings"][0]["clouds"]["shown"]) > 100
        finally:
            served.send_signal(signal.SIGINT)
    assert not list((tmp_path / "runs").glob(".looking-*"))
