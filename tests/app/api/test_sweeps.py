"""Sweeps over REST: what is refused, what is shown while one runs, and a whole one on a virtual
phantom.
"""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
from swept import first_points, write_swept_phantom

from palpate.app.settings import Settings

ASKED: dict[str, Any] = {
    "dataset": "phantom",
    "parameters": [{"parameter": "tool_radius.radius", "low": 4e-3, "high": 8e-3}],
    "steps": 5,
    "frames": 2,
}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of a server with one dataset, whose tool is larger than stated."""
    folder = tmp_path_factory.mktemp("swept")
    write_swept_phantom(folder / "datasets" / "phantom")
    return folder


def settings(home: Path) -> Settings:
    return Settings(runs=home / "runs", datasets=home / "datasets", preload=())


def ended(client: httpx.Client, identity: str) -> dict[str, Any]:
    end = time.monotonic() + 300
    while True:
        found = client.get(f"/api/sweeps/{identity}").json()
        if found["job"]["state"] not in ("queued", "running"):
            return found
        assert time.monotonic() < end
        time.sleep(0.2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parameters": []}, "parameters"),
        (
            {"parameters": [{"parameter": "poisson_ratio.nu", "low": 0.4, "high": 0.9}]},
            "outside 0 to 0.495",
        ),
        (
            {"parameters": [{"parameter": "nothing.at_all", "low": 0.4, "high": 0.9}]},
            "no effect is called",
        ),
        ({"method": "cmaes"}, "two parameters"),
        ({"steps": 1}, "steps"),
        ({"sequences": ["poke-99"]}, "no such sequence"),
        ({"fixed": {"poisson_ratio.mu": 1.0}}, "no parameter"),
        ({"scheduler": "tcp://elsewhere:1"}, "scheduler"),
    ],
)
def test_what_cannot_be_swept_is_refused(
    client: httpx.Client, change: dict[str, Any], said: str
) -> None:
    answer = client.post("/api/sweeps", json={**ASKED, "dataset": "small", **change})
    assert answer.status_code == 422
    assert set(answer.json()) == {"kind", "message", "where"}
    assert said in answer.json()["message"]


def test_what_is_not_there_is_said_to_be_missing(client: httpx.Client) -> None:
    assert client.post("/api/sweeps", json={**ASKED, "dataset": "nowhere"}).status_code == 404
    for path in ("nothing", "nothing/points", ".."):
        assert client.get(f"/api/sweeps/{path}").status_code == 404
    assert client.post("/api/sweeps/nothing/cancel").status_code == 404


def test_a_sweep_runs_and_its_points_come(home: Path, serve: Any) -> None:
    with serve(settings(home)) as client:
        started = client.post("/api/sweeps", json=ASKED)
        assert started.status_code == 202
        identity = started.json()["id"]
        found = ended(client, identity)
        assert found["job"]["state"] == "done", found
        assert found["summary"]["best"]["values"]["tool_radius.radius"] == pytest.approx(
            6e-3, abs=1e-9
        )
        first = client.get(f"/api/sweeps/{identity}/points", params={"most": 2}).json()
        rest = client.get(f"/api/sweeps/{identity}/points", params={"after": first["next"]}).json()
        numbers = [row["number"] for row in (*first["points"], *rest["points"])]
        assert sorted(numbers) == list(range(6)) and len(first["points"]) == 2
        best = found["summary"]["best"]["number"]
        replay = client.get(f"/api/sweeps/{identity}/points/{best}/replay").json()
        assert replay["effects"] == [{"effect": "tool_radius", "parameters": {"radius": 6e-3}}]
        assert client.post("/api/replays", json=replay).status_code == 202
        assert client.get(f"/api/sweeps/{identity}/points/99/replay").status_code == 404
        again = client.post("/api/sweeps", json=ASKED).json()["id"]
        assert ended(client, again)["summary"]["replays_computed"] == 0
        assert client.post(f"/api/sweeps/{again}/cancel").status_code == 409
        assert {row["id"] for row in client.get("/api/sweeps").json()} == {identity, again}


def test_a_sweep_that_is_stopped_keeps_its_points(home: Path, serve: Any) -> None:
    with serve(settings(home)) as client:
        asked = {**ASKED, "method": "random", "points": 300, "seed": 5}
        identity = client.post("/api/sweeps", json=asked).json()["id"]
        end = time.monotonic() + 120
        while not (known := client.get(f"/api/sweeps/{identity}/points").json()["points"]):
            assert time.monotonic() < end
            time.sleep(0.1)
        assert client.post(f"/api/sweeps/{identity}/cancel").json()["state"] == "cancelled"
        kept = client.get(f"/api/sweeps/{identity}/points").json()["points"]
        assert kept[: len(known)] == known and len(kept) < 300
    with serve(settings(home)) as client:
        assert client.get(f"/api/sweeps/{identity}/points").json()["points"][: len(known)] == known
        assert (
            json.loads((home / "runs" / "sweeps" / identity / "request.json").read_text())["points"]
            == 300
        )


def test_a_stopped_sweep_is_not_resumed_on_other_data(
    home: Path, tmp_path: Path, serve: Any
) -> None:
    shutil.copytree(home / "datasets", tmp_path / "datasets")
    with serve(settings(tmp_path)) as client:
        asked = {**ASKED, "method": "random", "points": 300, "seed": 6}
        identity = client.post("/api/sweeps", json=asked).json()["id"]
        first_points(client, identity)
        client.post(f"/api/sweeps/{identity}/cancel")
        before = client.get(f"/api/sweeps/{identity}").json()
        made = before["request"]["made_from"]["data"]
        rows = client.get(f"/api/sweeps/{identity}/points").json()["points"]
        assert before["data_changed"] is False and {row["data"] for row in rows} == {made}
        with (tmp_path / "datasets" / "phantom" / "touches.csv").open("a") as table:
            table.write("\n")
        assert client.get(f"/api/sweeps/{identity}").json()["data_changed"] is True
        assert client.post(f"/api/jobs/{identity}/retry").status_code == 202
        error = ended(client, identity)["job"]["error"]["message"]
        assert f"digest {made}" in error and "start a new sweep" in error
        assert client.get(f"/api/sweeps/{identity}/points").json()["points"] == rows
