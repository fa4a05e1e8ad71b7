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
    shown = client.post(f"/api/sessions/{page}/view", json=view(run_name, frame=2, layers=["raw", "tool"], colour="raw")).json()
    state = client.get(f"/api/sessions/{page}/state").json()
    assert state == shown
    assert (state["view"]["frame"], state["view"]["layers"]) == (2, ["raw", "tool"])
    assert sum(state["drawn"]["triangles"].values()) > 1000


def test_newest_of_many_views_is_the_one_that_stays(client: httpx.Client, page: str, run_name: str) -> None:
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
    assert {"measured", "raw", "extended", "corrected", "tool", "floor", "unseen", "landmark"} == set(palette["things"])
    assert len(palette["signed"]) == 15
