"""Attacks and bad luck against the server that the image starts."""

from __future__ import annotations

import gzip
import io
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import websockets
from entry_point import ended, entry_point, ports, printed, taken_memory
from job_functions import family
from small_dataset import ply_bytes, small_cloud, write_valid_dataset
from soaking import Clock
from swept import first_points, write_swept_phantom
from websockets.sync.client import connect
from websockets.typing import Subprotocol

pytestmark = pytest.mark.more
LARGEST = 600.0
"""Most memory that an attack may take over that of the idle server [MiB]."""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("image")


@pytest.fixture(scope="module")
def server(place: Path) -> Iterator[tuple[subprocess.Popen[str], httpx.Client]]:
    with entry_point(place) as served:
        yield served


@pytest.fixture
def client(server: tuple[subprocess.Popen[str], httpx.Client]) -> httpx.Client:
    return server[1]


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """An archive of a valid dataset."""
    folder = tmp_path_factory.mktemp("sent")
    write_valid_dataset(folder / "block")
    return Path(shutil.make_archive(str(folder / "sent"), "zip", folder, "block")).read_bytes()


def import_of(client: httpx.Client, name: str, content: bytes) -> dict[str, Any]:
    return dict(client.post(f"/api/imports?name={name}", content=content).raise_for_status().json())


def fork_server(pid: int) -> int:
    (found,) = [
        child
        for child in family(pid)
        if b"forkserver" in Path(f"/proc/{child}/cmdline").read_bytes()
    ]
    return found


def test_fork_server_killed_while_a_job_starts_loses_no_job(
    server: tuple[subprocess.Popen[str], httpx.Client], sent: bytes
) -> None:
    process, client = server
    made = fork_server(process.pid)
    os.kill(made, signal.SIGSTOP)
    jobs = [import_of(client, "starts", sent)]
    time.sleep(0.5)
    os.kill(made, signal.SIGKILL)
    jobs.append(import_of(client, "follows", sent))
    assert [ended(client, job["id"])["error"] for job in jobs] == [None, None]


def test_second_server_on_the_same_datasets_leaves_an_import_alone(
    server: tuple[subprocess.Popen[str], httpx.Client], place: Path, tmp_path: Path
) -> None:
    process, client = server
    block = write_valid_dataset(tmp_path / "large" / "block")
    cloud = np.tile(small_cloud(), (2 * 10**6 // len(small_cloud()), 1))
    (block / "rest.ply").write_bytes(ply_bytes(cloud))  # unpacked and checked for long enough
    archive = shutil.make_archive(str(tmp_path / "large"), "zip", tmp_path / "large", "block")
    before = set(family(process.pid))
    job = import_of(client, "shared", Path(archive).read_bytes())
    end = time.monotonic() + 60
    # Once there is a file, the worker has let go of the lock of the parent folder.
    while not list((place / "datasets").glob(".*/*/*")) and time.monotonic() < end:
        time.sleep(0.001)
    held = set(family(process.pid)) - before
    for one in held:
        os.kill(one, signal.SIGSTOP)
    try:
        with entry_point(tmp_path, "--datasets", str(place / "datasets")) as (_, other):
            assert other.get("/api/datasets").status_code == 200
    finally:
        for one in held:
            os.kill(one, signal.SIGCONT)
    done = ended(client, job["id"])
    assert held and done["state"] == "done", done["error"]
    assert (place / "datasets" / "shared" / "dataset.toml").is_file()


def long_name(kind: bytes) -> bytes:
    """A tar of 3 MB whose first header is a name of 3 GiB; gzip files may follow one another."""
    info = tarfile.TarInfo("././@LongLink")
    info.type, info.size = kind, 3 * 2**30
    head = gzip.compress(info.tobuf(tarfile.USTAR_FORMAT))
    return head + gzip.compress(b"a" * 2**26) * 48


def empty_rows() -> bytes:
    """A dataset in a zip, one table of which is 500 MB of line ends."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("block/dataset.toml", "format = 1\n")
        with archive.open("block/touches.csv", "w", force_zip64=True) as sink:
            for _ in range(500):
                sink.write(b"\n" * 10**6)
    return file.getvalue()


def large_cloud(sent: bytes) -> bytes:
    """A dataset in a zip of 2 MB, whose rest cloud has 17 million points, most at one place."""
    count = 17 * 10**6
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    noise = os.urandom(12 * 10**4)  # not so even that the ratio alone refuses it
    file = io.BytesIO()
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive,
        zipfile.ZipFile(io.BytesIO(sent)) as valid,
    ):
        for name in valid.namelist():
            if not name.endswith("rest.ply"):
                archive.writestr(name, valid.read(name))
        with archive.open("block/rest.ply", "w", force_zip64=True) as sink:
            sink.write(head.encode())
            for _ in range(17):
                sink.write(noise + bytes(12 * 10**6 - len(noise)))
    return file.getvalue()


@pytest.mark.parametrize(
    ("bomb", "told"),
    [
        ("pax", "a name or attribute in the archive has 3221225472 bytes"),
        ("gnu", "a name or attribute in the archive has 3221225472 bytes"),
        ("zip", "unpacked it is "),
        ("cloud", "has 17000000 points"),
    ],
)
def test_bomb_is_refused_and_takes_little_memory(
    server: tuple[subprocess.Popen[str], httpx.Client],
    sent: bytes,
    bomb: str,
    told: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    process, client = server
    content = {
        "pax": lambda: long_name(tarfile.XHDTYPE),
        "gnu": lambda: long_name(tarfile.GNUTYPE_LONGNAME),
        "zip": empty_rows,
        "cloud": lambda: large_cloud(sent),
    }[bomb]()
    with taken_memory(process.pid) as taken:
        answer = client.post(f"/api/imports?name={bomb}", content=content)
        error = answer.json()
        if answer.status_code < 300:
            error = ended(client, error["id"], 150.0)["error"]
    with capsys.disabled():
        sys.stdout.write(f"\n{bomb}: {len(content) / 1e6:.1f} MB take {taken[0]:.0f} MiB\n")
    assert answer.status_code < 500 and told in error["message"] and taken[0] < LARGEST


def test_many_readers_of_a_large_dataset_take_little_memory(
    server: tuple[subprocess.Popen[str], httpx.Client],
    place: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Five checks and six registering pages at once, of a rest cloud of 4 million points."""
    process, client = server
    cloud = np.tile(small_cloud(), (4 * 10**6 // len(small_cloud()) + 1, 1))[: 4 * 10**6]
    (write_valid_dataset(place / "datasets" / "large") / "rest.ply").write_bytes(ply_bytes(cloud))
    client.timeout = httpx.Timeout(300.0)
    ask = {
        "check": lambda _: client.get("/api/datasets/large/check"),
        "register": lambda page: client.post(
            f"/api/sessions/page-{page:08d}/registering", json={"dataset": "large", "pairs": []}
        ),
    }
    with taken_memory(process.pid) as taken, ThreadPoolExecutor(11) as readers:
        asked = [readers.submit(ask["check"], 0) for _ in range(5)]
        asked += [readers.submit(ask["register"], page) for page in range(6)]
        answers = [one.result() for one in asked]
    with capsys.disabled():
        sys.stdout.write(f"\nreaders: 4 million points take {taken[0]:.0f} MiB\n")
    assert all(answer.status_code == 200 for answer in answers), answers[-1].text
    assert taken[0] < LARGEST


def test_inner_port_of_the_scene_refuses_strangers(
    server: tuple[subprocess.Popen[str], httpx.Client],
) -> None:
    process, client = server
    spoken = [Subprotocol("viser-v1.1.1")]
    page = f"ws://127.0.0.1:{client.base_url.port}/viser/page-00000000"
    with connect(page, subprotocols=spoken, proxy=None):  # the scene starts with the first page
        inner = ports(process.pid) - {client.base_url.port}
        assert inner
        for port in inner:
            with pytest.raises(websockets.InvalidStatus, match="403"):
                connect(f"ws://127.0.0.1:{port}/", subprotocols=spoken, proxy=None)


def test_server_that_cannot_keep_jobs_tells_no_address(
    server: tuple[subprocess.Popen[str], httpx.Client], place: Path, tmp_path: Path
) -> None:
    second = printed("serve", "--port", "0", "--runs", str(place / "runs"))
    assert "another server works in" in second and "http://" not in second
    with sqlite3.connect(tmp_path / "jobs.sqlite") as database:
        database.execute("pragma user_version = 99")
    later = printed("serve", "--port", "0", "--runs", str(tmp_path))
    assert "http://" not in later and "Traceback" not in later and "version" in later


def test_jobs_of_one_second_have_an_id_each(tmp_path: Path, sent: bytes) -> None:
    """The clock stands still; of 600 ids that end in four hexadecimal digits two would be equal."""
    clock = Clock(tmp_path / "clock")
    clock.stop()
    with entry_point(tmp_path, more=clock.environment) as (process, client):
        os.kill(fork_server(process.pid), signal.SIGSTOP)  # none is done before the last has come

        def post(_: int) -> httpx.Response:
            return client.post("/api/imports?name=many", content=sent)

        with ThreadPoolExecutor(16) as threads:
            answers = list(threads.map(post, range(600)))
        os.kill(fork_server(process.pid), signal.SIGCONT)
        assert {answer.status_code for answer in answers} == {202}
        assert len({answer.json()["id"] for answer in answers}) == 600


def test_clock_that_is_set_back_makes_no_negative_time(tmp_path: Path, sent: bytes) -> None:
    clock = Clock(tmp_path / "clock")
    with entry_point(tmp_path, more=clock.environment) as (process, client):
        before = set(family(process.pid))
        job = import_of(client, "timed", sent)
        end = time.monotonic() + 60
        while not set(family(process.pid)) - before and time.monotonic() < end:
            time.sleep(0.005)
        clock.set(-3600)
        done = ended(client, job["id"])
    took = done.get("seconds", done["finished"] - done["started"])
    assert done["state"] == "done" and 0.0 <= took < 60.0


def test_sweep_is_not_resumed_on_other_data(tmp_path: Path) -> None:
    write_swept_phantom(tmp_path / "datasets" / "phantom")
    with entry_point(tmp_path) as (_, client):
        radius = {"parameter": "tool_radius.radius", "low": 4e-3, "high": 8e-3}
        asked = {"dataset": "phantom", "parameters": [radius], "frames": 1}
        many = {**asked, "method": "random", "points": 300, "seed": 6}
        identity = client.post("/api/sweeps", json=many).json()["id"]
        first_points(client, identity)
        client.post(f"/api/jobs/{identity}/cancel")
        with (tmp_path / "datasets" / "phantom" / "touches.csv").open("a") as table:
            table.write("\n")
        assert client.post(f"/api/jobs/{identity}/retry").status_code == 202
        assert "digest" in ended(client, identity)["error"]["message"]


def test_implausible_values_are_told_by_check(tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    toml = folder / "dataset.toml"
    toml.write_text(toml.read_text().replace("mass = 0.10401", "mass = 1e-5"))
    text = printed("check", str(folder))
    assert "1e-05" in text or "density" in text, text
