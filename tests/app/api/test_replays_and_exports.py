"""Registrations, replays and exports as jobs, in real worker processes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from palpate.app.client import ApiError, Client


@pytest.fixture(scope="module")
def palpate(client: httpx.Client) -> Iterator[Client]:
    with Client(str(client.base_url)) as found:
        yield found


def test_an_automatic_registration_is_kept_under_a_free_or_a_given_name(palpate: Client) -> None:
    named = palpate.wait(palpate.register("small", accept="mine")["id"])["result"]
    free = palpate.wait(palpate.register("small")["id"])["result"]
    assert (named["registration"], free["registration"]) == ("mine", "automatic-1")
    assert palpate.registrations("small") == ["automatic-1", "mine"]
    stored = palpate.registration("small", "mine")
    assert stored["points"] == [] and stored["registration"]["weak_directions"]
    with pytest.raises(ApiError, match="already"):
        palpate.register("small", accept="mine")


def test_a_registration_is_used_by_a_job_and_an_unknown_one_refused(
    palpate: Client, client: httpx.Client
) -> None:
    if "mine" not in palpate.registrations("small"):
        palpate.wait(palpate.register("small", accept="mine")["id"])
    for path, body in (
        ("/api/diagnoses", {"dataset": "small"}),
        ("/api/replays", {"dataset": "small"}),
        (
            "/api/sweeps",
            {
                "dataset": "small",
                "parameters": [{"parameter": "poisson_ratio.nu", "low": 0.3, "high": 0.4}],
            },
        ),
    ):
        assert client.post(path, json={**body, "registration": "none"}).status_code == 404


def test_a_replay_becomes_a_run_of_its_own(palpate: Client, client: httpx.Client) -> None:
    palpate.wait(palpate.register("small", accept="for-replay")["id"])
    effects = [{"effect": "tool_radius", "parameters": {"radius": 0.006}}]
    job = palpate.replay("small", sequences=["poke-01"], effects=effects, registration="for-replay")
    run = palpate.wait(job["id"])["result"]["run"]
    heading = client.get(f"/api/runs/{run}").json()
    assert heading["verdict"] == "replay" and heading["sentence"].startswith(
        "Replayed with the size of the tool"
    )
    made = client.get(f"/api/runs/{run}/report").json()["made_from"]
    assert made["data"] and made["version"] and made["code"]
    assert [one["name"] for one in heading["sequences"]] == ["poke-01"] and "for-replay" in heading[
        "notes"
    ][0]
    timeline_series = client.get(f"/api/runs/{run}/sequences/poke-01").json()
    assert len(timeline_series["time"]) == 5
    assert client.get(f"/api/runs/{run}/model").json()["registration"]["name"] == "for-replay"
    assert client.get(f"/api/runs/{run}/report.html").status_code == 200


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"dataset": "small", "sequences": ["none"]}, 422),
        ({"dataset": "none"}, 404),
        ({"dataset": "small", "effects": [{"effect": "none", "parameters": {}}]}, 422),
        (
            {
                "dataset": "small",
                "effects": [{"effect": "tool_radius", "parameters": {"radius": -1}}],
            },
            422,
        ),
    ],
)
def test_replays_that_cannot_be_are_refused_at_once(
    client: httpx.Client, body: Any, status: int
) -> None:
    assert client.post("/api/replays", json=body).status_code == status


def test_what_is_exported_is_there_to_take_away(
    palpate: Client, client: httpx.Client, run_name: str
) -> None:
    done = palpate.wait(palpate.export(run_name, what=["report", "model", "replays"])["id"])[
        "result"
    ]
    assert done["files"] == [
        f"{run_name}-model.json",
        f"{run_name}-replays.zip",
        f"{run_name}-report.json",
        f"{run_name}.html",
    ]
    page = client.get(f"/api/exports/{done['export']}/{run_name}.html")
    assert page.status_code == 200 and b"stiff lump" in page.content
    assert page.headers["content-disposition"].startswith("attachment")
    assert palpate.download(done["export"], f"{run_name}-replays.zip")[:2] == b"PK"
    assert client.get(f"/api/exports/{done['export']}/..%2f..%2forigin.json").status_code == 404
    assert client.get(f"/api/exports/{done['export']}/none").status_code == 404
    assert client.get("/api/exports/none").status_code == 404
    assert client.post("/api/exports", json={}).status_code == 422
    assert client.post("/api/exports", json={"run": "none"}).status_code == 404


def test_the_disk_is_told_and_emptied_of_caches_alone(
    client: httpx.Client, shared_place: Any
) -> None:
    cache = shared_place.runs / "sweeps" / ".replays" / "ab"
    cache.mkdir(parents=True)
    (cache / "one.json").write_bytes(b"x" * 1000)
    told = client.get("/api/disk").json()
    assert told["caches"] >= 1000 and told["used"] > told["caches"] and told["limit"] == 20 * 2**30
    after = client.post("/api/disk/empty").json()
    assert after["dropped"] >= 1000 and after["caches"] == 0 and not (cache / "one.json").exists()
    assert after["used"] == pytest.approx(told["used"] - 1000, rel=0.2)
