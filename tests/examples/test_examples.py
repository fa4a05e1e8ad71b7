"""The examples of the documentation run, in their order, and print what the tutorial says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the first example has made its dataset."""
    place = tmp_path_factory.mktemp("examples")
    assert "tool_radius" in _run("01_make_a_dataset.py", place)
    return place


def test_replay_is_compared_with_clouds(folder: Path) -> None:
    said = _run("02_replay_and_compare.py", folder)
    rms, force = map(float, re.findall(r"([\d.]+) (?:mm RMS|N)", said))
    assert 0 < rms < 2 and 0.01 < force < 10


def test_right_cause_lowers_the_error(folder: Path) -> None:
    said = _run("03_try_a_cause.py", folder)
    stated, thin = map(float, re.findall(r"([\d.]+) mm RMS", said))
    assert thin < stated


@pytest.mark.slow  # other tests make whole diagnoses
def test_cause_is_named_and_plotted(folder: Path) -> None:
    said = _run("04_name_the_cause.py", folder).splitlines()
    assert said[0] == "found" and said[1].startswith("tool_radius")
    assert (folder / "patterns.png").read_bytes().startswith(b"\x89PNG")


def _run(name: str, folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
