"""`palpate sweep` in a process of its own, on a virtual phantom."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from swept import write_swept_phantom


@pytest.fixture(scope="module")
def phantom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its tool is larger than stated."""
    return write_swept_phantom(tmp_path_factory.mktemp("swept") / "phantom")


def palpate(*words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, "-m", "palpate.app.cli", *words],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )


def test_a_sweep_prints_its_best_points_and_what_is_flat_and_is_known_the_second_time(
    phantom: Path, tmp_path: Path
) -> None:
    said = (
        "sweep",
        str(phantom),
        "-p",
        "tool_radius.radius=0.004:0.008",
        "-p",
        "young_modulus.E=2e3:2e5",
        "--steps",
        "3",
    )
    first, second = (palpate(*said, "--frames", "2", "--runs", str(tmp_path)) for _ in range(2))
    assert first.returncode == 0, first.stderr
    assert first.stdout == second.stdout
    assert "young_modulus.E: flat" in first.stdout and "tool_radius.radius: matters" in first.stdout
    best = next(line for line in first.stdout.splitlines() if "│" in line)
    assert "6.0" in best


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-p", "tool_radius.radius=4"), "is no range"),
        (("-p", "tool_radius.radius=0.004:0.008", "--fix", "gravity"), "fixes nothing"),
        (("-p", "tool_radius.radius=0.004:0.008", "--method", "best"), "expected one of grid"),
        (("-p", "tool_radius.radius=0.004:0.008", "--sequence", "none"), "no such sequence"),
    ],
)
def test_what_cannot_be_asked_is_said(
    phantom: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    found = palpate("sweep", str(phantom), *words, "--runs", str(tmp_path))
    assert found.returncode == 2 and said in found.stderr
