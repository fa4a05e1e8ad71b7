from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import httpx
import pytest
from small_dataset import write_valid_dataset

from palpate.dataset.provenance import made_from


@pytest.fixture
def base(run_name: str) -> str:
    return f"/api/runs/{run_name}"


def test_run_says_its_verdict_in_a_sentence_and_lists_its_sequences(
    client: httpx.Client, base: str
) -> None:
    run = client.get(base).json()
    assert run["sentence"].startswith("The simulation misses a stiff lump")
    assert run["size"] == [0.0687, 0.0393, 0.0358]
    assert [(one["name"], one["frames"], one["split"]) for one in run["sequences"]] == [
        ("drag-01", 5, "test"),
        ("poke-01", 5, "train"),
    ]
    assert run["has_clouds"]


def test_sequence_states_both_errors_of_its_worst_frame(client: httpx.Client, base: str) -> None:
    deepest = 0.003
    for one in client.get(base).json()["sequences"]:
        assert one["distance_raw"] == pytest.approx(0.2 * deepest)
        assert one["distance_extended"] == pytest.approx(0.02 * deepest)


def test_report_and_model_are_as_written(
    client: httpx.Client, base: str, report: dict[str, Any]
) -> None:
    assert client.get(f"{base}/report").json() == report
    assert client.get(f"{base}/model").json() == {"format": 1}


def test_patterns_have_null_where_unseen(client: httpx.Client, base: str) -> None:
    patterns = client.get(f"{base}/patterns").json()
    assert patterns["measured"][0] is None
    assert (
        len(patterns["measured"])
        == len(patterns["predicted"])
        == len(patterns["centres"])
        == len(patterns["normals"])
        == 45
    )
    assert patterns["limit"] > 0


def test_frames_of_a_sequence_start_at_zero_seconds(client: httpx.Client, base: str) -> None:
    frames = client.get(f"{base}/sequences/poke-01").json()
    assert frames["time"] == pytest.approx([0, 0.2, 0.4, 0.6, 0.8])
    assert (
        len(frames["distance_raw"])
        == len(frames["distance_extended"])
        == len(frames["outcome"])
        == 5
    )
    assert frames["noise_floor"] == pytest.approx(1e-5)


def test_picture_is_served_and_nothing_beside_it(client: httpx.Client, base: str) -> None:
    assert client.get(f"{base}/pictures/patterns.png").headers["content-type"] == "image/png"
    for name in ("nothing.png", "..%2freport.json", "%2e%2e"):
        assert client.get(f"{base}/pictures/{name}").status_code == 404


def test_broken_run_is_409_and_does_not_hide_the_others(
    client: httpx.Client, shared_place: Any, base: str
) -> None:
    (shared_place.runs / "torn").mkdir()
    (shared_place.runs / "torn" / "report.json").write_text("{")
    assert client.get("/api/runs/torn").status_code == 409
    damaged = {
        "deep": '{"a":' * 20_000 + "1" + "}" * 20_000,
        "half": '{"dataset": "\\ud800", "verdict": "found"}',
        "kinds": '{"dataset": [1], "verdict": 5, "causes": [1, 2], "made_from": [3]}',
    }
    for name, text in damaged.items():
        (shared_place.runs / name).mkdir()
        (shared_place.runs / name / "report.json").write_text(text)
    verdicts = {run["id"]: run["verdict"] for run in client.get("/api/runs").json()}
    unreadable = dict.fromkeys(("torn", *damaged), "unreadable")
    assert verdicts == {**unreadable, base.rsplit("/", 1)[1]: "found"}
    for name in ("torn", *damaged):
        shutil.rmtree(shared_place.runs / name)


def test_run_tells_that_its_data_have_changed_since(
    client: httpx.Client, shared_place: Any, base: str, tmp_path: Path
) -> None:
    """The dataset is that of the run's origin, wherever it lies."""
    folder = write_valid_dataset(tmp_path / "elsewhere")
    run = shared_place.runs / "measured"
    shutil.copytree(shared_place.runs / base.rsplit("/", 1)[1], run)
    file = run / "origin.json"
    origin = {**json.loads(file.read_text()), "dataset": str(folder)}
    file.write_text(json.dumps(origin))
    assert client.get("/api/runs/measured").json()["data_changed"] is None
    file.write_text(json.dumps({**origin, "made_from": made_from(folder)}))
    assert client.get("/api/runs/measured").json()["data_changed"] is False
    (folder / "touches.csv").write_text((folder / "touches.csv").read_text() + "\n")
    listed = {one["id"]: one["data_changed"] for one in client.get("/api/runs").json()}
    assert listed["measured"] is True
    shutil.rmtree(run)
