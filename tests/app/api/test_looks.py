"""Looks over REST, in real worker processes: upload, look, edit, import, delete."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from bench_recording import BenchRecording, bench_setup
from shapes import box_surface, write_felt_shape
from small_dataset import write_valid_dataset

from palpate.app.client import Client, JobError
from palpate.app.settings import Settings
from palpate.dataset import open_dataset


@pytest.fixture(scope="module")
def palpate(client: httpx.Client) -> Iterator[Client]:
    with Client(str(client.base_url)) as found:
        yield found


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    bench_setup(folder)
    BenchRecording(rate=50.0).write(folder / "bench.bag")
    return folder


def uploaded(client: httpx.Client, name: str, content: bytes) -> str:
    answer = client.post("/api/uploads", params={"file": name}, content=content)
    assert answer.status_code == 201, answer.text
    return str(answer.json()["file"])


def taken(palpate: Client, body: dict[str, Any]) -> dict[str, Any]:
    """The look that a request gives."""
    job = palpate.wait(palpate.look(**body)["id"])
    assert job["kind"] == "look" and job["result"] == {"look": job["id"]}
    return palpate.look_result(job["id"])


@pytest.fixture(scope="module")
def look(palpate: Client, bench: Path) -> dict[str, Any]:
    token = palpate.upload(bench / "bench.bag")
    setup = (bench / "dataset.toml").read_text()
    return taken(palpate, {"files": [token], "setup": setup, "name": "monday"})


def test_an_upload_is_looked_at_with_a_stated_setup(
    client: httpx.Client, look: dict[str, Any]
) -> None:
    assert look["source"] == {
        "kind": "recording",
        "files": ["files/bench.bag"],
        "name": "monday",
        "dataset": None,
    }
    assert look["request"]["files"][0].startswith("upload-") and look["request"]["setup"]
    assert look["setup_stated"] and len(look["recordings"][0]["sequences"]) == 4
    rows = client.get("/api/looks").raise_for_status().json()
    (row,) = (row for row in rows if row["id"] == look["id"])
    assert row["source"]["name"] == "monday" and row["source"]["recordings"] == 1
    assert row["job"]["state"] == "done"


def test_edited_sequences_with_their_splits_become_the_dataset(
    client: httpx.Client, palpate: Client, shared_place: Any, look: dict[str, Any]
) -> None:
    first, second, *_ = look["recordings"][0]["sequences"]
    sequences = [
        {**first, "recording": "bench", "name": "gentle", "split": "test"},
        {**second, "recording": "bench", "end": second["end"] - 1.0, "split": "train"},
    ]
    mapping = look["mapping"].replace('[wrench]\nframe = ""', '[wrench]\nframe = "tool"')
    body = {"name": "monday-block", "mapping": mapping, "sequences": sequences}
    job = palpate.wait(palpate.import_look(look["id"], **body)["id"])
    assert job["kind"] == "import" and job["dataset"] == "monday-block"
    result = job["result"]
    assert (result["dataset"], result["sequences"]) == ("monday-block", 2)
    assert result["clouds"] > 20 and isinstance(result["warnings"], list)
    made = open_dataset(shared_place.datasets / "monday-block")
    assert (made.config.train, made.config.test) == (("poke-top-02",), ("gentle",))
    assert made.config.validation == ()
    end = made.sequence("poke-top-02").kinematics.time[-1]
    assert end == pytest.approx(second["end"] - 1.0, abs=0.03)
    assert not list(shared_place.datasets.glob(".importing/*"))
    again = client.post(f"/api/looks/{look['id']}/import", json=body)
    assert again.status_code == 409


def test_a_sequence_of_an_unknown_recording_is_refused_by_the_job(
    client: httpx.Client, palpate: Client, look: dict[str, Any]
) -> None:
    window = {"name": "a", "recording": "none", "start": 0.0, "end": 1.0, "kind": "", "split": ""}
    body = {"name": "never", "sequences": [window]}
    job = client.post(f"/api/looks/{look['id']}/import", json=body).json()
    with pytest.raises(JobError, match="expected one of bench"):
        palpate.wait(job["id"])
    bad = {"name": "never", "sequences": [{**window, "split": "some"}]}
    assert client.post(f"/api/looks/{look['id']}/import", json=bad).status_code == 422


@pytest.mark.more
def test_a_packed_folder_and_a_dataset_are_looked_at(
    client: httpx.Client, palpate: Client, tmp_path: Path
) -> None:
    folder, data = write_valid_dataset(tmp_path / "block"), io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, f"block/{path.relative_to(folder)}")
    packed = taken(palpate, {"files": [uploaded(client, "block.zip", data.getvalue())]})
    named = taken(palpate, {"dataset": "small"})
    for one in (packed, named):
        assert [row["name"] for row in one["recordings"]] == ["drag-01", "poke-01"]
        assert one["source"]["kind"] == "dataset" and one["cleaned"]
    answer = client.post(f"/api/looks/{named['id']}/import", json={"name": "twice"})
    assert answer.status_code == 409 and "there already" in answer.json()["message"]


@pytest.mark.more
def test_a_look_is_deleted_with_the_recording_that_was_uploaded_for_it(
    client: httpx.Client, palpate: Client, shared_place: Any, bench: Path
) -> None:
    token = uploaded(client, "other.bag", (bench / "bench.bag").read_bytes())
    found = taken(palpate, {"files": [token]})
    folder = shared_place.runs / "looks" / found["id"]
    assert (folder / "files" / "other.bag").is_file()
    assert client.delete(f"/api/looks/{found['id']}").status_code == 204
    assert not folder.exists() and client.get(f"/api/looks/{found['id']}").status_code == 404
    assert client.delete(f"/api/looks/{found['id']}").status_code == 404


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({}, 422),
        ({"files": []}, 422),
        ({"files": ["/no/such/file.bag"]}, 422),
        ({"files": ["upload-" + "0" * 32]}, 404),
        ({"dataset": "none"}, 404),
        ({"dataset": "small", "setup": ""}, 422),
        ({"dataset": "../small"}, 422),
        ({"files": ["a\0b"]}, 422),
    ],
)
def test_what_cannot_be_looked_at_is_refused_at_once(
    client: httpx.Client, body: dict[str, Any], status: int
) -> None:
    answer = client.post("/api/looks", json=body)
    assert answer.status_code == status and set(answer.json()) == {"kind", "message", "where"}


@pytest.mark.parametrize("name", ["../x.bag", "a/b.bag", ".hidden", "a\nb", "\u20ac" * 90])
def test_names_that_no_file_may_have_are_refused(client: httpx.Client, name: str) -> None:
    answer = client.post("/api/uploads", params={"file": name}, content=b"x")
    assert answer.status_code == 422, answer.text


def test_an_empty_upload_leaves_nothing(client: httpx.Client, shared_place: Any) -> None:
    before = set(shared_place.runs.glob("uploads/recordings/*"))
    assert client.post("/api/uploads", params={"file": "x.bag"}, content=b"").status_code == 422
    assert set(shared_place.runs.glob("uploads/recordings/*")) == before


def test_an_edited_mapping_reaches_nothing_beyond_the_look(
    palpate: Client, look: dict[str, Any], tmp_path: Path
) -> None:
    secret = tmp_path / "secret.csv"
    secret.write_text("landmark,x,y,z\n")
    mapping = look["mapping"].replace('touches = ""', f'touches = "{secret}"')
    job = palpate.import_look(look["id"], "stolen", mapping=mapping)
    with pytest.raises(JobError, match="which is not among the files"):
        palpate.wait(job["id"])


def test_a_path_that_may_not_be_imported_from_is_not_looked_at(
    serve: Any, place: Any, bench: Path, tmp_path: Path
) -> None:
    settings = Settings(
        runs=place.runs, datasets=place.datasets, preload=(), import_from=(tmp_path / "open",)
    )
    with serve(settings) as client:
        refused = client.post("/api/looks", json={"files": [str(bench / "bench.bag")]})
    assert refused.status_code == 422 and "--import-from" in refused.json()["message"]


def test_the_setup_of_a_dataset_is_taken_with_its_surface(
    client: httpx.Client, palpate: Client, shared_place: Any, bench: Path
) -> None:
    felt = shared_place.datasets / "felt"
    felt.mkdir()
    write_felt_shape(felt, *box_surface((0.06, 0.04, 0.03)))
    surface = felt / "phantom.stl"
    token = palpate.upload(bench / "bench.bag")
    body = {"files": [token], "setup_dataset": "felt", "name": "as-felt"}
    found = taken(palpate, body)
    assert found["setup_stated"] and surface.name in found["mapping"]
    assert "splits" not in found["mapping"]
    files = shared_place.runs / "looks" / found["id"] / "files"
    assert (files / surface.name).read_bytes() == surface.read_bytes()
    twice = client.post("/api/looks", json={**body, "setup": "name = 'a'"})
    assert (twice.status_code, twice.json()["where"]["key"]) == (422, "setup")
    assert client.post("/api/looks", json={**body, "setup_dataset": "none"}).status_code == 404
