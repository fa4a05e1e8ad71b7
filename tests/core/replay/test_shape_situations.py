"""Random situations on bodies of any shape, kept in a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.shape_situations import ABOVE_BASE, BODIES, draw_on_shape, main
from palpate.fem.newton import Outcome


def test_situations_are_kept_and_an_interrupted_run_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = tmp_path / "situations.jsonl"
    store.write_text('{"seed": 1, "label": "liv')
    assert main(1, 1, store, 10.0) == 0
    kept = store.read_text()
    assert len(kept.splitlines()) == 2
    assert main(1, 1, store, 0.0) == 0 and store.read_text() == kept
    assert "liver 0" in capsys.readouterr().out


def test_frame_without_equilibrium_or_a_fault_fails_the_run(tmp_path: Path) -> None:
    store = tmp_path / "situations.jsonl"
    entry = '{"seed": 0, "label": "dome 0", "outcomes": ["%s"], "faults": [%s], "cpu": 1.0}\n'
    for outcome, fault, status in (
        (Outcome.CONVERGED.name, "", 0),
        (Outcome.PULLED.name, "", 1),
        (Outcome.CONVERGED.name, '"frame 0: not a number"', 1),
    ):
        store.write_text(entry % (outcome, fault))
        assert main(1, 0, store, 0.0) == status


def test_ten_bodies_are_pushed_above_their_base() -> None:
    assert len(set(BODIES)) == 10
    for seed in range(4):
        situation, body = draw_on_shape(seed)
        assert body == "{} {}".format(*BODIES[seed])
        assert situation.centres[:, 2].min() > situation.setup.tool.radius + ABOVE_BASE
        gaps = situation.setup.geometry.facing_free(situation.centres)[0]
        assert gaps.min() < situation.setup.tool.radius < gaps[0]
