"""`palpate import`: streams, mapping, dataset, and again."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bench_recording import BenchRecording, bench_setup
from recorded_bags import write_sequence_bag
from small_dataset import write_valid_dataset

from palpate.app.cli import main
from palpate.app.commands import console
from palpate.dataset import open_dataset
from palpate.importing.opened_bags import CACHE

Palpate = Callable[..., tuple[int, str, str]]


@pytest.fixture
def palpate(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Palpate:
    """Run a verb in this process: exit code, output and errors."""
    monkeypatch.setattr(console.out, "width", 200)

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


def test_a_recording_becomes_a_checked_dataset_by_way_of_its_mapping(
    palpate: Palpate, bench: Path, tmp_path: Path
) -> None:
    mapping, made = tmp_path / "import.toml", tmp_path / "made"
    setup = bench / "dataset.toml"
    code, out, _ = palpate("import", bench / "bench.bag", "--setup", setup, "--mapping", mapping)
    assert code == 0
    assert "/PSM1/measured_cp" in out and "2.0 ms" in out and "9.0 ms" in out
    assert "state [wrench] frame" in out
    code, _, err = palpate("import", "--mapping", mapping, "--to", made)
    assert code == 2
    assert "frame of the forces is not known" in err
    assert not made.exists()
    text = mapping.read_text()
    mapping.write_text(
        text.replace('[wrench]\nframe = ""', '[wrench]\nframe = "tool"').replace(
            'zero = "none"\nweight = "none"', 'zero = "fitted"\nweight = "fitted"'
        )
    )
    code, out, _ = palpate("import", "--mapping", mapping, "--to", made)
    assert code == 0
    assert "poke-top-02" in out and "touches miss their landmarks" in out
    assert open_dataset(made).sequences == ("drag-01", "poke-side-01", "poke-top-01", "poke-top-02")
    code, out, _ = palpate("import", "--mapping", made / "import.toml", "--to", made, "--again")
    assert code == 0
    taken = "unchanged, taken over: poke-top-01, poke-top-02, poke-side-01, drag-01"
    assert taken in out


def test_without_a_place_nothing_is_written(palpate: Palpate, bench: Path, tmp_path: Path) -> None:
    before = sorted(bench.iterdir())
    code, out, _ = palpate("import", bench)
    assert code == 0
    assert "[streams]" in out and 'pose = "/PSM1/measured_cp"' in out
    assert sorted(bench.iterdir()) == before


def test_a_mapping_beside_files_is_refused(palpate: Palpate, bench: Path, tmp_path: Path) -> None:
    mapping = tmp_path / "import.toml"
    assert palpate("import", bench, "--mapping", mapping)[0] == 0
    code, _, err = palpate("import", bench, "--mapping", mapping)
    assert code == 2
    assert "states the recordings already" in err


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("[pose]\nframe", "[pose]\nframes = 1\nframe"),
        ('stamps = "header"', 'stamps = "heads"'),
        ("lead = 1.5", "lead = -3"),
    ],
)
def test_wrong_keys_of_the_mapping_are_named(
    palpate: Palpate, bench: Path, tmp_path: Path, wrong: str, said: str
) -> None:
    mapping = tmp_path / "import.toml"
    assert palpate("import", bench, "--mapping", mapping)[0] == 0
    mapping.write_text(mapping.read_text().replace(wrong, said))
    code, _, err = palpate("import", "--mapping", mapping, "--to", tmp_path / "made")
    assert code == 2
    key = re.findall(r"(\w+) =", said)[0]
    assert key in err and "correct this key" in err


def test_without_any_file_it_is_said_what_is_expected(palpate: Palpate) -> None:
    code, _, err = palpate("import")
    assert code == 2
    assert "expected recordings, or --mapping" in err


def test_verbs_open_a_dataset_with_bags(
    palpate: Palpate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables, bags = write_valid_dataset(tmp_path / "tables"), tmp_path / "bags"
    shutil.copytree(tables, bags, ignore=shutil.ignore_patterns("sequences"))
    topics = '[topics]\npose = "/PSM1/measured_cp"\ncloud = "/camera/points"\n'
    (bags / "dataset.toml").write_text((tables / "dataset.toml").read_text() + topics)
    (bags / "sequences").mkdir()
    for name in ("poke-01", "drag-01"):
        write_sequence_bag(tables, name, bags / "sequences" / f"{name}.bag", "ros1")
    monkeypatch.setenv(CACHE, str(tmp_path / "cache"))
    code, out, err = palpate("register", bags)
    assert code == 0, err
    assert "phantom from robot" in out and "opened as" in err
    (bags / "sequences" / "poke-01.bag").write_bytes(b"no bag")
    code, _, err = palpate("check", bags)
    assert code == 2 and "poke-01.bag cannot be read" in err


def test_tables_are_shown_as_they_are_understood(palpate: Palpate, tmp_path: Path) -> None:
    rows = [f"{0.01 * at:.2f},{100 + 9 * at},0,50,90,0,0,1" for at in range(40)]
    header = "t,x (mm),y (mm),z (mm),roll (deg),pitch (deg),yaw (deg),gripper"
    (tmp_path / "poses.csv").write_text("\n".join([header, *rows]) + "\n")
    code, out, _ = palpate("import", tmp_path / "poses.csv")
    assert code == 0
    assert "first of 40 rows, as they are understood" in out
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "x [m] x (mm) mm 0.1, 0.109, 0.118" in lines
    assert "qx roll (deg), pitch (deg), yaw (deg) euler-xyz deg 0.7071, 0.7071, 0.7071" in lines
    assert "not used: gripper" in out
    code, _, err = palpate("import", tmp_path / "poses.csv", "--preset", "gel")
    assert code == 2
    assert "there is no preset 'gel'; expected simulator-network, pokeflex" in err
