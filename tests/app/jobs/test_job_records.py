"""The file of job records: of earlier versions, of a later one, and interrupted migrations."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from palpate.app.jobs.job_records import VERSION, Job, JobRecords, JobState
from palpate.foundation.errors import RunError

FIRST = """
create table jobs (
    id text primary key, kind text not null, request text not null, state text not null,
    fraction real not null, text text not null, created real not null, started real,
    finished real, error text, result text
);
create table log (job text not null, at real not null, level text not null, text text not null);
insert into jobs values
    ('old', 'sweep', '{"name": "block"}', 'done', 1, 'done', 1, 2, 3, null, '{}');
insert into log values ('old', 2.5, 'info', 'halfway');
"""
"""Tables of the first version, with a job."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "jobs.sqlite"
    database = sqlite3.connect(path)
    database.executescript(FIRST)
    database.close()
    return path


def test_file_of_the_first_version_is_read_and_its_copy_stays(file: Path) -> None:
    records = JobRecords(file)
    job = records.get("old")
    assert (job.state, job.attempt, job.key, job.seconds) == (JobState.DONE, 1, None, 0.0)
    assert [note.text for note in records.notes("old")] == ["halfway"]
    assert records.add(Job(id="new", kind="sweep", request={}, key="once"))
    records.close()
    copy = sqlite3.connect(file.with_name("jobs-version-0.sqlite"))
    assert [row[1] for row in copy.execute("pragma table_info(jobs)")][-1] == "result"
    assert copy.execute("select id from jobs").fetchall() == [("old",)]
    copy.close()


def test_present_version_is_opened_without_a_copy(tmp_path: Path) -> None:
    for _ in range(2):
        records = JobRecords(tmp_path / "jobs.sqlite")
        records.close()
    names = {path.name for path in tmp_path.iterdir()}
    assert not any("version" in name for name in names)
    database = sqlite3.connect(tmp_path / "jobs.sqlite")
    assert database.execute("pragma user_version").fetchone() == (VERSION,)
    database.close()


def test_later_version_is_refused_and_left_as_it_is(file: Path) -> None:
    database = sqlite3.connect(file)
    database.execute(f"pragma user_version = {VERSION + 1}")
    database.close()
    before = file.read_bytes()
    with pytest.raises(RunError, match="later Palpate"):
        JobRecords(file)
    assert file.read_bytes() == before


def test_migration_that_was_interrupted_is_made_again(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OSError("the machine stopped")

    with monkeypatch.context() as patch:
        patch.setattr("palpate.app.jobs.job_records.os.replace", broken)
        with pytest.raises(OSError, match="stopped"):
            JobRecords(file)
    records = JobRecords(file)
    assert records.get("old").attempt == 1
    records.close()


@pytest.mark.parametrize("content", [b"no database", b"SQLite format 3\0" + b"x" * 5000, None])
def test_file_that_is_no_database_is_refused_with_what_to_do(
    tmp_path: Path, content: bytes | None
) -> None:
    path = tmp_path / "jobs.sqlite"
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    with pytest.raises(RunError, match="move it away, and a new one is made"):
        JobRecords(path)


def test_damaged_record_does_not_hide_the_others(tmp_path: Path) -> None:
    records = JobRecords(tmp_path / "jobs.sqlite")
    for name in ("whole", "cut"):
        assert records.add(Job(id=name, kind="sweep", request={"of": 1}))
    records.close()
    database = sqlite3.connect(tmp_path / "jobs.sqlite")
    with database:
        database.execute("update jobs set request = '{\"of' where id = 'cut'")
    database.close()
    records = JobRecords(tmp_path / "jobs.sqlite")
    assert {job.id: job.request for job in records.all()} == {"whole": {"of": 1}, "cut": {}}
    records.close()
