"""The Python client against a real server."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from palpate.app.client import ApiError, Client, JobError

TARGETS = {"diagnosis": "job_functions:refuse", "sweep": "job_functions:warn"}


@pytest.fixture(scope="module")
def palpate(serve: Any, shared_place: Any) -> Iterator[Client]:
    with serve(shared_place.settings, TARGETS) as http, Client(str(http.base_url)) as client:
        yield client


def test_what_there_is_is_read(palpate: Client, run_name: str) -> None:
    assert palpate.datasets() == ["small"]
    assert palpate.check("small")["name"] == "small-block"
    assert "tool_radius" in [effect["name"] for effect in palpate.effects()]
    assert palpate.report(run_name)["verdict"] == "found"


def test_a_job_is_followed_to_its_end_and_the_same_key_is_the_same_job(palpate: Client) -> None:
    seen: list[tuple[float, str]] = []
    job = palpate.sweep("small", {"poisson_ratio.nu": (0.3, 0.4)}, key="mine", steps=3)
    assert (
        palpate.sweep("small", {"poisson_ratio.nu": (0.3, 0.4)}, key="mine", steps=3)["id"]
        == job["id"]
    )
    assert (
        palpate.wait(job["id"], lambda fraction, text: seen.append((fraction, text)))["state"]
        == "done"
    )
    assert seen[-1] == (1.0, "done")
    assert job["id"] in [one["id"] for one in palpate.jobs()]
    with pytest.raises(ApiError, match="another request") as refused:
        palpate.sweep("small", {"poisson_ratio.nu": (0.3, 0.45)}, key="mine", steps=3)
    assert (refused.value.status, refused.value.kind) == (409, "Conflict")


def test_what_fails_says_why_in_the_words_of_the_service(palpate: Client) -> None:
    job = palpate.diagnose("small")
    with pytest.raises(JobError, match=r"touches\.csv, row 3: nan"):
        palpate.wait(job["id"])
    assert palpate.retry(job["id"])["attempt"] == 2
    with pytest.raises(JobError):
        palpate.wait(job["id"])
    with pytest.raises(ApiError, match="failed already"):
        palpate.cancel(job["id"])
    with pytest.raises(ApiError, match="there is no dataset nothing") as refused:
        palpate.diagnose("nothing")
    assert refused.value.status == 404


def test_a_question_whose_connection_broke_is_asked_again() -> None:
    body = b'{"folder": "", "datasets": ["one"]}'
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer_the_second() -> None:
            for reply in (b"", b"HTTP/1.1 200 OK\r\ncontent-length: %d\r\n\r\n" % len(body) + body):
                connection, _ = listener.accept()
                with connection:
                    connection.recv(4096)
                    connection.sendall(reply)

        server = threading.Thread(target=answer_the_second, daemon=True)
        server.start()
        with Client(f"http://127.0.0.1:{listener.getsockname()[1]}") as client:
            assert client.datasets() == ["one"]
        server.join(timeout=60)
        assert not server.is_alive()
