"""Results that take room: named by size, deleted whole, and bounded in all by the limit."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from palpate.app.http_errors import Missing
from palpate.app.settings import Settings
from palpate.app.storage.disk_usage import Disk
from palpate.app.storage.stored_results import StoredResults


def _stored(runs: Path, folder: str, first: str, size: int) -> Path:
    path = runs / folder
    path.mkdir(parents=True)
    (path / first).write_text("{}")
    (path / "data.npz").write_bytes(b"x" * size)
    return path


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A run with corrected frames, a sweep and a training."""
    _stored(tmp_path, "small", "report.json", 100)
    _stored(tmp_path, "corrections/small", "poke.npz", 3000)
    _stored(tmp_path, "sweeps/wide", "request.json", 2000)
    _stored(tmp_path, "trainings/net", "request.json", 1000)
    return tmp_path


def test_results_are_named_the_largest_first_and_deleted_with_all_that_is_theirs(
    runs: Path,
) -> None:
    results = StoredResults(runs)
    assert [(one.kind, one.name) for one in results.largest(9)] == [
        ("run", "small"),
        ("sweep", "wide"),
        ("training", "net"),
    ]
    assert results.largest(1)[0].bytes == 3104
    results.delete("run", "small")
    assert not (runs / "small").exists() and not (runs / "corrections" / "small").exists()
    assert [one.name for one in results.largest(9)] == ["wide", "net"]


@pytest.mark.parametrize(
    ("kind", "name"), [("run", "none"), ("run", ".."), ("run", "sweeps"), ("dataset", "small")]
)
def test_nothing_else_is_deleted(runs: Path, kind: str, name: str) -> None:
    before = sorted(runs.rglob("*"))
    with pytest.raises(Missing):
        StoredResults(runs).delete(kind, name)
    assert sorted(runs.rglob("*")) == before


def test_no_job_begins_where_results_take_more_than_they_may(
    runs: Path, shared_place: Any, serve: Any
) -> None:
    settings = Settings(
        runs=runs, datasets=shared_place.settings.datasets, preload=(), disk_limit=2500
    )
    with serve(settings, {"diagnosis": "job_functions:warn"}) as client:
        refused = client.post("/api/diagnoses", json={"dataset": "small"})
        assert refused.status_code == 507
        assert "first of all run small" in refused.json()["message"]
        named = client.get("/api/disk").json()["largest"]
        assert [one["name"] for one in named] == ["small", "wide", "net"]
        for one in named[:2]:
            answer = client.delete(f"/api/disk/{one['kind']}/{one['name']}")
            assert answer.status_code == 200 and one not in answer.json()["largest"]
        assert client.delete("/api/disk/run/small").status_code == 404
        # The database of jobs counts, too.
        raised = Settings(**{**json.loads(settings.model_dump_json()), "disk_limit": 10**9})
    with serve(raised, {"diagnosis": "job_functions:warn"}) as client:
        begun = client.post("/api/diagnoses", json={"dataset": "small"})
        assert begun.status_code == 202


def test_what_is_at_work_is_not_deleted(tmp_path: Path, serve: Any, shared_place: Any) -> None:
    settings = Settings(runs=tmp_path, datasets=shared_place.settings.datasets, preload=())
    with serve(settings, {"sweep": "job_functions:linger"}) as client:
        asked = {
            "dataset": "small",
            "parameters": [{"parameter": "tool_radius.radius", "low": 4e-3, "high": 8e-3}],
        }
        job = client.post("/api/sweeps", json=asked).json()["id"]
        assert client.delete(f"/api/disk/sweep/{job}").status_code == 409
        client.post(f"/api/sweeps/{job}/cancel")


def test_results_are_listed_while_others_are_deleted(
    tmp_path: Path, serve: Any, shared_place: Any
) -> None:
    settings = Settings(runs=tmp_path, datasets=shared_place.settings.datasets, preload=())
    names = [f"run-{number}" for number in range(60)]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "report.json").write_text("{}")
    with serve(settings) as client, ThreadPoolExecutor(6) as others:
        paths = ["/api/runs", "/api/disk"] * 30
        asked = [others.submit(client.get, path) for path in paths]
        asked += [
            others.submit(client.delete, f"/api/disk/run/{name}") for name in names for _ in (0, 1)
        ]
        codes = {one.result().status_code for one in asked}
    assert codes <= {200, 404} and not list(tmp_path.glob("run-*"))


def test_exports_are_deleted_for_room_like_other_caches(tmp_path: Path) -> None:
    export = tmp_path / "exports" / "export-block-1" / "report.json"
    export.parent.mkdir(parents=True)
    export.write_bytes(b"x" * 1000)
    assert Disk(tmp_path, 500).trim().dropped == 1000 and not export.exists()
