from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest
from broken_datasets import BREAKAGES, REPRESENTATIVE, write_valid_dataset


def test_datasets_are_those_of_the_folder(client: httpx.Client) -> None:
    assert "small" in client.get("/api/datasets").json()["datasets"]


def test_check_tells_what_is_there_and_what_is_doubtful(client: httpx.Client) -> None:
    found = client.get("/api/datasets/small/check").json()
    assert found["name"] == "small-block"
    assert {one["name"]: (one["clouds"], one["split"]) for one in found["sequences"]} == {
        "poke-01": (5, "train"),
        "drag-01": (5, "test"),
    }
    assert isinstance(found["warnings"], list)
    assert isinstance(found["lacks"], list)


@pytest.mark.parametrize(
    "name",
    ["..", "%2e%2e", "..%2f..%2fetc", "/etc", "small%2f..%2fsmall", "nothing", ".hidden", "a%00b"],
)
def test_names_that_lead_elsewhere_are_refused(client: httpx.Client, name: str) -> None:
    assert client.get(f"/api/datasets/{name}/check").status_code in (404, 422)
    assert client.post("/api/diagnoses", json={"dataset": name}).status_code in (404, 422)


def test_link_out_of_the_folder_is_refused(
    client: httpx.Client, shared_place: Any, tmp_path: Path
) -> None:
    write_valid_dataset(tmp_path / "outside")
    (shared_place.datasets / "linked").symlink_to(tmp_path / "outside")
    answer = client.post("/api/diagnoses", json={"dataset": "linked"})
    assert answer.status_code == 422
    assert "leads out of the datasets folder" in answer.json()["message"]


@pytest.mark.parametrize("kind", REPRESENTATIVE)
def test_broken_dataset_is_refused_with_its_place_and_leaves_nothing(
    client: httpx.Client, shared_place: Any, kind: str
) -> None:
    name = f"broken-{sorted(BREAKAGES).index(kind)}"
    BREAKAGES[kind](write_valid_dataset(shared_place.datasets / name))
    jobs, runs = client.get("/api/jobs").json(), sorted(shared_place.runs.iterdir())
    for answer in (
        client.get(f"/api/datasets/{name}/check"),
        client.post("/api/diagnoses", json={"dataset": name}),
    ):
        assert 400 <= answer.status_code < 500, answer.text
        problem = answer.json()
        assert set(problem) == {"kind", "message", "where"}
        assert problem["message"]
        if answer.status_code == 422:
            assert problem["kind"] == "DatasetError"
            expected = {key: str(value) for key, value in BREAKAGES[kind].where.items()}
            assert {
                key: str(value) for key, value in problem["where"].items() if key in expected
            } == expected
            assert all(word in problem["message"] for word in BREAKAGES[kind].says)
    assert client.get("/api/jobs").json() == jobs
    assert sorted(shared_place.runs.iterdir()) == runs
