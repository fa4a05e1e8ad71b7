from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

WORK = '''
import os, pathlib, shutil, time

def take(request, report):
    """Make a run without computing: the run of the fixture under another name."""
    runs, scratch = pathlib.Path(request["runs"]), pathlib.Path(request["scratch"])
    for step in range(request["seed"] or 3):
        report(step / 100, f"step {step}")
        time.sleep(0.05)
    shutil.copytree(runs / "small-block-1", scratch / "made")
    os.rename(scratch / "made", runs / scratch.name)
    return {"run": scratch.name, "verdict": "found"}
'''


@pytest.fixture
def client(place: Any, serve: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (tmp_path / "taken_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    with serve(place.settings, {"diagnosis": "taken_work:take"}) as found:
        yield found


def wait(client: httpx.Client, identity: str, *states: str) -> dict[str, Any]:
    end = time.monotonic() + 30
    while (job := client.get(f"/api/diagnoses/{identity}").json())["state"] not in states:
        assert time.monotonic() < end, job
        time.sleep(0.05)
    return dict(job)


def test_diagnosis_goes_from_request_to_report(
    client: httpx.Client, report: dict[str, Any]
) -> None:
    answer = client.post("/api/diagnoses", json={"dataset": "small"})
    assert answer.status_code == 202
    identity = answer.json()["id"]
    done = wait(client, identity, "done", "failed")
    assert (done["state"], done["fraction"], done["dataset"]) == ("done", 1.0, "small")
    assert client.get(f"/api/diagnoses/{identity}/report").json() == report
    assert identity in [run["id"] for run in client.get("/api/runs").json()]
    assert identity in [job["id"] for job in client.get("/api/diagnoses").json()]


def test_cancelled_diagnosis_leaves_nothing_behind(client: httpx.Client, place: Any) -> None:
    identity = client.post("/api/diagnoses", json={"dataset": "small", "seed": 1000}).json()["id"]
    wait(client, identity, "running")
    assert client.get(f"/api/diagnoses/{identity}/report").status_code == 409
    assert client.post(f"/api/jobs/{identity}/cancel").json()["state"] == "cancelled"
    assert client.post(f"/api/jobs/{identity}/cancel").status_code == 409
    end = time.monotonic() + 10
    while any((place.runs / ".making").iterdir()) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any((place.runs / ".making").iterdir())
    assert [
        path.name
        for path in place.runs.iterdir()
        if path.is_dir() and not path.name.startswith(".")
    ] == ["small-block-1"]


def test_jobs_tell_their_progress_while_they_run(client: httpx.Client) -> None:
    seen: list[list[dict[str, Any]]] = []

    def listen() -> None:
        with client.stream("GET", "/api/jobs/events") as events:
            for line in events.iter_lines():
                if line.startswith("data: "):
                    seen.append(json.loads(line.removeprefix("data: ")))
                if seen and seen[-1] and seen[-1][0]["state"] == "done":
                    return

    listener = threading.Thread(target=listen)
    listener.start()
    client.post("/api/diagnoses", json={"dataset": "small", "seed": 12})
    listener.join(timeout=30)
    assert not listener.is_alive()
    fractions = [jobs[0]["fraction"] for jobs in seen if jobs]
    assert fractions == sorted(fractions)
    assert len(set(fractions)) >= 3


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"dataset": 3},
        {"dataset": "small", "seed": -1},
        {"dataset": "small", "folder": "/etc"},
        [],
        {"dataset": None},
    ],
)
def test_requests_that_make_no_sense_are_told_why(client: httpx.Client, body: Any) -> None:
    answer = client.post("/api/diagnoses", json=body)
    assert answer.status_code == 422
    assert answer.json()["kind"] == "RequestError"


@pytest.mark.parametrize(
    "path",
    ["jobs/nothing", "diagnoses/nothing", "diagnoses/nothing/report", "runs/nothing", "nothing"],
)
def test_what_is_not_there_is_404_with_a_message(client: httpx.Client, path: str) -> None:
    answer = client.get(f"/api/{path}")
    assert answer.status_code == 404
    assert set(answer.json()) == {"kind", "message", "where"}
