"""Every operation keeps to its description, whatever it is sent: no fault of ours, and no answer
that is not announced.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings, strategies
from raw_requests import answered, raw
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from palpate.app.main import create_app
from palpate.app.settings import Settings

ENDLESS = "/api/jobs/events"
DESCRIBED = create_app(Settings(), {}).openapi()["paths"]
OPERATIONS = [
    (path, method) for path, methods in DESCRIBED.items() for method in methods if path != ENDLESS
]
REPEATABLE = settings(
    deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]


@pytest.fixture(scope="module")
def api(serve: Any, shared_place: Any) -> Iterator[tuple[Any, httpx.Client]]:
    """The description as the server gives it; jobs do nothing, since this is about asking for
    them."""
    with serve(
        shared_place.settings, dict.fromkeys(("diagnosis", "sweep"), "job_functions:warn")
    ) as client:
        yield schemathesis.openapi.from_url(f"{client.base_url}/openapi.json"), client


@pytest.mark.parametrize(("path", "method"), OPERATIONS, ids=str)
def test_operation_keeps_to_its_description(
    api: tuple[Any, httpx.Client], run_name: str, path: str, method: str
) -> None:
    schema, client = api
    jobs = [job["id"] for job in client.get("/api/jobs").json()]
    known = {
        "name": "small" if "/datasets/" in path else run_name,
        "sequence": "drag-01",
        "identity": (jobs or ["none"])[0],
    }
    answers: list[int] = []

    @settings(REPEATABLE, max_examples=30)
    @given(case=schema[path][method.upper()].as_strategy(), real=strategies.booleans())
    def keeps(case: Any, real: bool) -> None:
        if real:  # a name that nothing has leads nowhere
            case.path_parameters.update(
                {key: value for key, value in known.items() if key in case.path_parameters}
            )
        answers.append(case.call_and_validate(checks=CHECKS).status_code)

    keeps()
    assert answers and max(answers) < 500, answers


NAMES = [
    "small",
    "drag-01",
    "%00",
    "x" * 300,
    "%ED%A0%80",
    "%FF",
    "..%2f..",
    "%0d%0a",
    "%F0%9F%92%A9",
]
HEADERS = (
    *("accept", "accept-encoding", "authorization", "connection", "content-encoding"),
    *("content-length", "content-type", "cookie", "expect", "forwarded", "host", "idempotency-key"),
    *("if-modified-since", "if-none-match", "origin", "range", "referer", "te", "upgrade"),
    *("transfer-encoding", "x-forwarded-for", "x-forwarded-host", "x-http-method-override"),
)
VALUES = strategies.one_of(
    strategies.sampled_from(
        [
            "",
            "*/*;q=x",
            "Basic ====",
            "Bearer \u00ff",
            'a=b; a="',
            "application/json; charset=nothing",
            "bytes=9-1,-0",
            "for=[::1",
            "gzip, gzip, gzip",
            "http://[bad",
            "multipart/form-data",
            "multipart/form-data; boundary=",
            "null",
            "websocket",
            "x" * 9000,
        ]
    ),
    strategies.text(strategies.characters(min_codepoint=33, max_codepoint=255), max_size=60),
)


@pytest.mark.parametrize(("path", "method"), OPERATIONS, ids=str)
def test_no_path_and_no_header_makes_a_fault_of_the_server(
    api: tuple[Any, httpx.Client], path: str, method: str
) -> None:
    schema, client = api
    answers: list[int] = []

    @settings(REPEATABLE, max_examples=15)
    @given(
        case=schema[path][method.upper()].as_strategy(),
        names=strategies.lists(strategies.sampled_from(NAMES), min_size=2, max_size=2),
        headers=strategies.dictionaries(strategies.sampled_from(HEADERS), VALUES, max_size=4),
    )
    def asked(case: Any, names: list[str], headers: dict[str, str]) -> None:
        hostile = iter(names)
        url = re.sub(r"{\w+}", lambda _: next(hostile), path)
        values = {key: str(value) for key, value in (case.query or {}).items()}
        query = urlencode(values, errors="replace")
        body = json.dumps(case.body).encode() if isinstance(case.body, dict | list) else b""
        sent = {"content-length": str(len(body)), "connection": "close", **headers}
        lines = [f"{name}: {value}" for name, value in sent.items()]
        answer = answered(client, raw(client, f"{method.upper()} {url}?{query}", *lines, body=body))
        assert not answer or re.match(rb"HTTP/1.1 [1-4]", answer), (sent, answer[:200])
        answers.append(len(answer))

    asked()
    assert max(answers) > 0
    assert client.get("/health").status_code == 200


def test_every_operation_says_what_it_does_and_what_may_go_wrong() -> None:
    for path, methods in DESCRIBED.items():
        if path == "/health":  # open to probes, and answered 503 by its own body
            assert set(methods["get"]["responses"]) == {"200", "503"}
            continue
        for method, said in methods.items():
            assert len(said["description"]) > 10, (path, method)
            assert {"401", "404", "409", "413", "422"} <= set(said["responses"]), (path, method)
            for status, answer in said["responses"].items():
                problem = (
                    answer.get("content", {})
                    .get("application/json", {})
                    .get("schema", {})
                    .get("$ref", "")
                )
                assert problem.endswith("/Problem") == (int(status) >= 400), (path, method, status)


def test_every_body_has_an_example_every_job_takes_a_key_and_every_list_has_pages() -> None:
    schemas = create_app(Settings(), {}).openapi()["components"]["schemas"]
    for path, methods in DESCRIBED.items():
        for method, said in methods.items():
            parameters = {one["name"] for one in said.get("parameters", [])}
            body = (
                said.get("requestBody", {})
                .get("content", {})
                .get("application/json", {})
                .get("schema", {})
                .get("$ref", "")
            )
            assert not body or schemas[body.split("/")[-1]].get("examples"), (path, method)
            assert (
                "202" not in said["responses"]
                or path.endswith("/retry")
                or "Idempotency-Key" in parameters
            ), (path, method)
            answer = (
                said["responses"]
                .get("200", {})
                .get("content", {})
                .get("application/json", {})
                .get("schema", {})
            )
            assert (
                answer.get("type") != "array"
                or path == "/api/effects"
                or {"after", "most"} <= parameters
            ), (path, method)


def test_the_page_says_where_the_description_is(api: tuple[Any, httpx.Client]) -> None:
    assert api[1].get("/openapi.json").json()["info"]["title"] == "Palpate"
