from __future__ import annotations

import json
import uuid
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect


@pytest.fixture
def page() -> str:
    return str(uuid.uuid4())


def view(run: str, **changes: Any) -> dict[str, Any]:
    return {"run": run, "sequence": "poke-01", **changes}


def test_view_is_held_and_can_be_asked_for(client: httpx.Client, page: str, run_name: str) -> None:
    shown = client.post(
        f"/api/sessions/{page}/view",
        json=view(run_name, frame=2, layers=["raw", "tool"], colour="raw"),
    ).json()
    state = client.get(f"/api/sessions/{page}/state").json()
    assert state == shown
    assert (state["view"]["frame"], state["view"]["layers"]) == (2, ["raw", "tool"])
    assert sum(state["drawn"]["triangles"].values()) > 1000


def test_newest_of_many_views_is_the_one_that_stays(
    client: httpx.Client, page: str, run_name: str
) -> None:
    address = f"ws://{client.base_url.host}:{client.base_url.port}/api/sessions/{page}/socket"
    with connect(address) as socket:
        for frame in (*range(5), *range(4, -1, -1)):
            socket.send(json.dumps(view(run_name, frame=frame, colour="extended")))
        socket.send(json.dumps(view(run_name, frame=3, colour="raw")))
        answers = [json.loads(socket.recv(timeout=10))]
        while answers[-1]["view"]["colour"] != "raw":
            answers.append(json.loads(socket.recv(timeout=10)))
    assert client.get(f"/api/sessions/{page}/state").json()["drawn"] == answers[-1]["drawn"]
    assert answers[-1]["view"]["frame"] == 3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"frame": -1}, "greater"),
        ({"sequence": "poke-99"}, "no sequence"),
        ({"run": "x"}, "no run"),
        ({"zoom": 2}, "not permitted"),
    ],
)
def test_socket_answers_a_bad_view_and_lives_on(
    client: httpx.Client, page: str, run_name: str, changes: dict[str, Any], words: str
) -> None:
    address = f"ws://{client.base_url.host}:{client.base_url.port}/api/sessions/{page}/socket"
    with connect(address) as socket:
        socket.send(json.dumps({**view(run_name), **changes}))
        assert words in json.loads(socket.recv(timeout=10))["problem"]["message"]
        socket.send(json.dumps(view(run_name)))
        assert json.loads(socket.recv(timeout=10))["view"]["frame"] == 0


def test_page_that_never_showed_anything_is_404(client: httpx.Client, page: str) -> None:
    assert client.get(f"/api/sessions/{page}/state").status_code == 404
    assert client.post(f"/api/sessions/{page}/look").status_code == 404


def test_palette_is_complete(client: httpx.Client) -> None:
    palette = client.get("/api/palette").json()
    assert {
        "measured",
        "raw",
        "extended",
        "corrected",
        "tool",
        "floor",
        "unseen",
        "landmark",
    } == set(palette["things"])
    assert len(palette["signed"]) == 15


def test_a_page_without_a_browser_has_no_still_and_unknown_views_are_refused(
    client: httpx.Client, page: str, run_name: str
) -> None:
    page = f"/api/sessions/{page}"
    client.post(f"{page}/view", json={"run": run_name, "sequence": "poke-01"})
    answer = client.get(f"{page}/still.png")
    assert answer.status_code == 404 and "no browser shows this page" in answer.json()["message"]
    for size in (0, 5000, "wide"):
        assert client.get(f"{page}/still.png", params={"width": size}).status_code == 422
    assert [
        client.post(f"{page}/look", params={"where": where}).status_code
        for where in ("top", "front", "side", "reset")
    ] == [204] * 4
    assert client.post(f"{page}/look", params={"where": "below"}).status_code == 422


def test_a_camera_is_a_place_and_a_target(client: httpx.Client, page: str, run_name: str) -> None:
    page = f"/api/sessions/{page}"
    camera = {"run": run_name, "position": [0.1, 0.1, 0.2], "target": [0, 0, 0.02]}
    assert client.put(f"{page}/camera", json=camera).status_code == 204
    for wrong in ({"position": [0, 0]}, {"target": "here"}, {"position": [1e9, 0, 0]}, {"lens": 3}):
        assert client.put(f"{page}/camera", json={**camera, **wrong}).status_code == 422


@pytest.mark.parametrize(
    "wrong",
    [
        {"layers": ["magic"]},
        {"quantity": "colour"},
        {"section": {"axis": "w"}},
        {"section": {"at": 2}},
        {"looks": {"raw": {"opacity": 0}}},
    ],
)
def test_views_that_cannot_be_drawn_are_refused_by_name(
    client: httpx.Client, page: str, run_name: str, wrong: dict[str, Any]
) -> None:
    answer = client.post(
        f"/api/sessions/{page}/view", json={"run": run_name, "sequence": "poke-01", **wrong}
    )
    assert answer.status_code == 422
    assert next(iter(wrong)) in answer.json()["where"]["key"]


def test_one_scale_serves_all_sequences_of_a_run(
    client: httpx.Client, page: str, run_name: str
) -> None:
    view = {
        "run": run_name,
        "layers": ["raw"],
        "colour": "raw",
        "quantity": "displacement",
        "scale": "fixed",
    }
    limits = {
        client.post(f"/api/sessions/{page}/view", json={**view, "sequence": name}).json()["drawn"][
            "limit"
        ]
        for name in ("poke-01", "drag-01")
    }
    assert len(limits) == 1 and limits.pop() > 1e-3
