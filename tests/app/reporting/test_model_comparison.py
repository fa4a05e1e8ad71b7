"""Models side by side over sequences, on runs whose errors are known."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from palpate.app.reporting.model_comparison import compared, sequence_errors
from palpate.app.storage.run_store import Run
from palpate.foundation.errors import RunError


@pytest.fixture
def run(place: Any, run_name: str) -> Run:
    return Run(place.runs / run_name)


def rewrite(run: Run, sequence: str, **arrays: object) -> None:
    path = run.path / "replays" / f"{sequence}.npz"
    with np.load(path) as stored:
        kept = {name: stored[name] for name in stored.files}
    np.savez(path, **{**kept, **arrays})  # type: ignore[arg-type]


def test_error_of_a_sequence_is_the_rms_over_frames_that_both_models_have(run: Run) -> None:
    raw = np.array([3e-4, 4e-4, np.nan, 9e-3, 3e-4])
    extended = np.array([1e-4, 1e-4, 1e-4, np.nan, 1e-4])
    rewrite(run, "drag-01", distance_raw=raw, distance_extended=extended, noise_floor=5e-5)
    row = next(row for row in sequence_errors(run) if row.sequence == "drag-01")
    assert (row.split, row.frames) == ("test", 3)
    assert row.raw is not None and row.raw == pytest.approx(np.sqrt((9 + 16 + 9) / 3) * 1e-4)
    assert row.extended == pytest.approx(1e-4)
    assert row.removed == pytest.approx((row.raw - 1e-4) / (row.raw - 5e-5))


def test_no_more_than_all_of_the_error_is_removed(run: Run) -> None:
    rewrite(
        run,
        "drag-01",
        distance_raw=np.full(5, 3e-4),
        distance_extended=np.full(5, 1e-4),
        noise_floor=1.5e-4,
    )
    row = next(row for row in sequence_errors(run) if row.sequence == "drag-01")
    assert row.extended == pytest.approx(1e-4) and row.removed == 1.0


def test_sequences_that_were_fitted_on_come_first(run: Run) -> None:
    assert [row.split for row in sequence_errors(run)] == ["train", "test"]


def test_sequence_that_was_never_seen_has_no_error(run: Run) -> None:
    rewrite(run, "poke-01", distance_raw=np.full(5, np.nan), distance_extended=np.full(5, np.nan))
    row = sequence_errors(run)[0]
    assert (row.frames, row.raw, row.extended, row.removed) == (0, None, None, None)


def test_model_at_its_noise_floor_has_nothing_to_remove(run: Run) -> None:
    rewrite(run, "poke-01", noise_floor=1.0)
    assert sequence_errors(run)[0].removed is None
    raw = sequence_errors(run)[0].raw
    assert raw is not None
    rewrite(run, "poke-01", noise_floor=raw / 1.01)
    assert sequence_errors(run)[0].removed is None
    rewrite(run, "poke-01", noise_floor=raw / 1.05)
    assert sequence_errors(run)[0].removed is not None


def test_runs_of_one_dataset_stand_beside_each_other(run: Run) -> None:
    other = Run(Path(shutil.copytree(run.path, run.path.with_name("other"))))
    (other.path / "replays" / "drag-01.npz").unlink()
    found = compared([run, other])
    assert [one["id"] for one in found["runs"]] == [run.name, "other"]
    rows = {row["sequence"]: row["models"] for row in found["sequences"]}
    assert rows["poke-01"][run.name] == rows["poke-01"]["other"]
    assert rows["drag-01"]["other"] is None and rows["drag-01"][run.name] is not None


def test_runs_of_several_datasets_are_not_compared(run: Run) -> None:
    other = Run(Path(shutil.copytree(run.path, run.path.with_name("other"))))
    (other.path / "report.json").write_text(json.dumps({**run.report, "dataset": "another-block"}))
    with pytest.raises(RunError, match="other of another-block"):
        compared([run, other])
    with pytest.raises(RunError, match="no run"):
        compared([])


def test_comparison_over_rest(client: httpx.Client, run_name: str) -> None:
    url = f"/api/runs/{run_name}/comparison"
    found = client.get(url).json()
    assert [row["sequence"] for row in found["sequences"]] == ["poke-01", "drag-01"]
    assert found["sequences"][1]["models"][run_name]["split"] == "test"
    assert client.get(url, params={"beside": run_name}).json() == found
    assert client.get(url, params={"beside": "nothing"}).status_code == 404
