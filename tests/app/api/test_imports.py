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
from small_dataset import write_valid_dataset

from palpate.app.client import Client, JobError


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
