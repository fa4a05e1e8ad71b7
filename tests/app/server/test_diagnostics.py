"""The text for a report of a fault, from the service and from the command line."""

from __future__ import annotations

import json
import logging
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import httpx
import pytest
from job_functions import TARGETS, ended
from typer.testing import CliRunner

from palpate.app.cli import app as cli
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.server.diagnostics import LOG, diagnostics, note_settings, write_log
from palpate.app.settings import Settings


@pytest.fixture(autouse=True)
def own_handlers() -> Iterator[None]:
    """Take the handlers of each test off again."""
    loggers = [logging.getLogger(name) for name in (None, "uvicorn")]
    before = [list(one.handlers) for one in loggers]
    yield
    for one, handlers in zip(loggers, before, strict=True):
        for handler in set(one.handlers) - set(handlers):
            one.removeHandler(handler)
            handler.close()


def test_last_jobs_and_log_are_in_it(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    with closing(JobQueue(runs, TARGETS)) as jobs:
        failed = ended(jobs, jobs.submit("stumble", {}, label="block"))
        write_log(runs)
        logging.getLogger("palpate.test").warning("the disk is slow")
        text = diagnostics(runs, {"workers": 2})
    assert f"{failed.id}: stumble, failed" in text
    assert "    info: started, attempt 1" in text
    assert "WARNING palpate.test: the disk is slow" in text
    assert "workers = 2" in text and "torch 2" in text and " processors" in text


def test_log_rotates(tmp_path: Path) -> None:
    write_log(tmp_path)
    log = logging.getLogger("palpate.test")
    for number in range(80):
        log.warning("%d %s", number, "x" * 2**17)
    parts = list(tmp_path.glob(f"{LOG}*"))
    assert len(parts) == 5 and max(part.stat().st_size for part in parts) < 1.3 * 2**20


def test_without_any_runs_it_says_so(tmp_path: Path) -> None:
    text = diagnostics(tmp_path / "missing" / "runs", Settings().model_dump(mode="json"))
    assert "[last jobs]\nnone" in text and "[log]\nempty" in text
    assert not (tmp_path / "missing").exists()


def test_damaged_records_are_told(tmp_path: Path) -> None:
    (tmp_path / "jobs.sqlite").write_bytes(b"no database at all" * 100)
    assert "[last jobs]\ncannot be read: " in diagnostics(tmp_path, {})


def test_the_page_gets_it_as_a_file(client: httpx.Client) -> None:
    answer = client.get("/api/diagnostics").raise_for_status()
    assert "palpate-diagnostics.txt" in answer.headers["content-disposition"]
    assert answer.text.startswith("Palpate diagnostics, ")


def test_doctor_prints_the_settings_of_the_server(tmp_path: Path) -> None:
    note_settings(tmp_path, Settings(workers=7).model_dump(mode="json"))
    printed = CliRunner().invoke(cli, ["doctor", "--runs", str(tmp_path)])
    assert printed.exit_code == 0 and "workers = 7" in printed.stdout
    printed = CliRunner().invoke(cli, ["doctor", "--runs", str(tmp_path / "none")])
    assert "no server was started with these runs" in printed.stdout


def test_rows_of_a_dataset_that_an_error_names_are_left_out(tmp_path: Path) -> None:
    with closing(JobQueue(tmp_path, TARGETS)) as jobs:
        job = jobs.submit("stumble", {}, label="block")
        error = {"kind": "DatasetError", "message": "a row is bad", "where": {"value": "1.23456"}}
        ended(jobs, job)
        database = sqlite3.connect(tmp_path / "jobs.sqlite")
        with database:
            database.execute("update jobs set error = ?", [json.dumps(error)])
        database.close()
        text = diagnostics(tmp_path, {})
    assert "DatasetError: a row is bad" in text and "1.23456" not in text
