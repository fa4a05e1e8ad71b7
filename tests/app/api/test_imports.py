"""Datasets that are brought over REST, in real worker processes."""

from __future__ import annotations

import io
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from shapes import box_surface, write_felt_shape
from small_dataset import write_valid_dataset

from palpate.app.client import Client, JobError
from palpate.app.jobs.job_records import Job, JobState
from palpate.app.services import _tidy
from palpate.app.storage.disk_usage import Disk


@pytest.fixture(scope="module")
def palpate(client: httpx.Client) -> Iterator[Client]:
    with Client(str(client.base_url)) as found:
        yield found


def packed(folder: Path, kind: str = "zip") -> bytes:
    data = io.BytesIO()
    if kind == "zip":
        with zipfile.ZipFile(data, "w") as archive:
            for path in sorted(folder.rglob("*")):
                archive.write(path, f"{folder.name}/{path.relative_to(folder)}")
    else:
        with tarfile.open(fileobj=data, mode="w:gz") as tape:
            tape.add(folder, folder.name)
    return data.getvalue()


def leftovers(place: Any) -> list[str]:
    return [
        str(path) for path in (*place.datasets.glob(".importing/*"), *place.runs.glob(".making/*"))
    ]


@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_an_archive_becomes_a_dataset(
    palpate: Client, shared_place: Any, tmp_path: Path, kind: str
) -> None:
    job = palpate.import_archive(write_archive(tmp_path, kind), f"brought-{kind}")
    done = palpate.wait(job["id"])
    assert done["result"] == {"dataset": f"brought-{kind}", "sequences": 2, "clouds": 10}
    assert (
        f"brought-{kind}" in palpate.datasets() and palpate.check(f"brought-{kind}")["touches"] == 4
    )
    assert leftovers(shared_place) == [] and list((shared_place.runs / "uploads").iterdir()) == []


def write_archive(folder: Path, kind: str) -> Path:
    file = folder / f"a.{kind}"
    file.write_bytes(packed(write_valid_dataset(folder / "block"), kind))
    return file


def test_a_broken_one_is_refused_as_a_whole_with_every_problem(
    palpate: Client, shared_place: Any, tmp_path: Path
) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    (folder / "touches.csv").unlink()
    (folder / "sequences/poke-01/kinematics.csv").write_text(
        "t,x,y,z,qx,qy,qz,qw\n1,2\n2,x,0,0,0,0,0,1\n"
    )
    (tmp_path / "a.zip").write_bytes(packed(folder))
    with pytest.raises(JobError) as caught:
        palpate.wait(palpate.import_archive(tmp_path / "a.zip", "broken")["id"])
    said = caught.value.job["error"]
    assert "3 problems" in said["message"] and "touches.csv" in said["message"]
    assert "kinematics.csv, row 2" in said["message"] and "kinematics.csv, row 3" in said["message"]
    assert said["where"]["problems"] == 3
    assert "broken" not in palpate.datasets() and leftovers(shared_place) == []


def test_a_folder_on_the_server_is_copied(palpate: Client, tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "there")
    before = sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*"))
    assert (
        palpate.wait(palpate.import_folder(str(folder), "copied")["id"])["result"]["dataset"]
        == "copied"
    )
    assert sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*")) == before


@pytest.mark.parametrize(
    ("body", "name", "status"),
    [
        (b"no archive", "new", 422),
        (b"", "new", 422),
        (b"PK\x03\x04cut", "new", 422),
        (None, "..", 422),
        (None, "a/b", 422),
        (None, ".hidden", 422),
        (None, "small", 409),
        (None, "x" * 80, 422),
    ],
)
def test_bodies_and_names_that_are_none_are_refused_at_once(
    client: httpx.Client,
    shared_place: Any,
    tmp_path: Path,
    body: bytes | None,
    name: str,
    status: int,
) -> None:
    content = packed(write_valid_dataset(tmp_path / "block")) if body is None else body
    answer = client.post("/api/imports", params={"name": name}, content=content)
    assert answer.status_code == status and set(answer.json()) == {"kind", "message", "where"}
    assert not list(shared_place.runs.glob("uploads/.*"))


def test_an_upload_that_is_too_large_is_refused_whether_announced_or_not(
    place: Any, serve: Any
) -> None:
    with serve(place.settings.model_copy(update={"largest_upload": 5000})) as client:
        said = client.post("/api/imports?name=large", content=b"x" * 6000)
        chunked = client.post("/api/imports?name=large", content=iter([b"x" * 3000, b"x" * 3000]))
        assert said.status_code == chunked.status_code == 413
        assert not list(place.runs.glob("uploads/*"))


def test_folders_are_imported_from_where_that_is_allowed_only(
    place: Any, serve: Any, tmp_path: Path
) -> None:
    folder = write_valid_dataset(tmp_path / "secret" / "block")
    with serve(place.settings.model_copy(update={"import_from": (tmp_path / "open",)})) as client:
        for path in (str(folder), f"{tmp_path}/open/../secret/block", "/etc"):
            answer = client.post("/api/imports/folder", json={"folder": path, "name": "new"})
            assert (
                answer.status_code == 422 and "may not be imported from" in answer.json()["message"]
            )


def test_the_same_archive_under_two_names_is_two_datasets(palpate: Client, tmp_path: Path) -> None:
    """The first import deleted the archive of the second."""
    file = write_archive(tmp_path, "zip")
    jobs = [palpate.import_archive(file, name) for name in ("first", "second")]
    assert [palpate.wait(job["id"])["state"] for job in jobs] == ["done", "done"]


def test_the_same_archive_under_the_same_key_is_one_import(
    client: httpx.Client, tmp_path: Path
) -> None:
    content = packed(write_valid_dataset(tmp_path / "block"))
    asked = [
        client.post(
            "/api/imports",
            params={"name": "once"},
            content=content,
            headers={"idempotency-key": "import-1"},
        ).json()
        for _ in range(2)
    ]
    assert asked[0]["id"] == asked[1]["id"]


def test_a_request_whose_answer_was_lost_is_answered_by_its_job(
    palpate: Client, client: httpx.Client, tmp_path: Path, shared_place: Any
) -> None:
    file = write_archive(tmp_path, "zip")
    headers = {"idempotency-key": "import-lost"}
    answers = []
    for _ in range(2):
        content = file.read_bytes()
        answers.append(client.post("/api/imports?name=lost", content=content, headers=headers))
        palpate.wait(answers[-1].json()["id"])
    assert [answer.status_code for answer in answers] == [202, 202]
    assert answers[0].json()["id"] == answers[1].json()["id"]
    assert not list((shared_place.runs / "uploads").iterdir())
    other = client.post("/api/imports?name=lost", content=content)
    assert other.status_code == 409


def test_a_phantom_of_any_shape_is_imported(palpate: Client, tmp_path: Path) -> None:
    """The check of its surface needs a library that is larger than the limit of memory."""
    (tmp_path / "felt").mkdir()
    folder = write_felt_shape(tmp_path / "felt", *box_surface((0.06, 0.04, 0.03)))
    file = tmp_path / "felt.zip"
    file.write_bytes(packed(folder))
    assert palpate.wait(palpate.import_archive(file, "felt")["id"])["state"] == "done"


def test_an_archive_that_waits_is_not_deleted_for_room(tmp_path: Path) -> None:
    folder = tmp_path / "uploads"
    folder.mkdir()
    files = [folder / name for name in ("waits", "failed", "done")]
    states = [JobState.QUEUED, JobState.FAILED, JobState.DONE]
    for file in files:
        file.write_bytes(bytes(1000))
    jobs = [
        Job(id=file.name, kind="import", request={"archive": str(file)}, state=state)
        for file, state in zip(files, states, strict=True)
    ]
    assert "oldest caches" in _tidy(Disk(tmp_path, 0), jobs, [])
    assert [file.exists() for file in files] == [True, True, False]


def test_upload_outlives_the_emptying_of_caches(client: httpx.Client, tmp_path: Path) -> None:
    content = packed(write_valid_dataset(tmp_path / "block"))

    def parts() -> Iterator[bytes]:
        yield content[:2000]
        httpx.post(f"{client.base_url}/api/disk/empty").raise_for_status()
        yield content[2000:]

    answer = client.post("/api/imports?name=emptied", content=parts())
    assert answer.status_code == 202, answer.text


def test_archive_that_no_import_takes_is_deleted(
    client: httpx.Client, shared_place: Any, tmp_path: Path
) -> None:
    key = {"idempotency-key": "taken-by-another"}
    client.post("/api/diagnoses", json={"dataset": "small"}, headers=key).raise_for_status()
    content = packed(write_valid_dataset(tmp_path / "block"))
    answer = client.post("/api/imports?name=unwanted", content=content, headers=key)
    assert answer.status_code == 409
    assert not list(shared_place.runs.glob("uploads/*unwanted*"))
