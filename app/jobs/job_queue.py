"""Long tasks as jobs: one queue, one worker process each, progress through a pipe.

The table of records is the queue, so that waiting jobs outlive the server, and jobs that ran when
the server or the worker was killed are known to be interrupted.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import queue
import secrets
import shutil
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from palpate.app.http_errors import Conflict, Missing, NoSpace
from palpate.app.jobs.job_records import Job, JobRecords, JobState, Note
from palpate.app.jobs.job_runner import ENDING, JobRunner
from palpate.app.storage.held_folder import drop_left_behind
from palpate.foundation.errors import RunError, SetupError

__all__ = ["JobQueue"]

log = logging.getLogger(__name__)
LONGEST_LABEL = 150
"""Letters of a label in an id, so that the id can name a file: also an export's, which names its
dataset's or run's."""
_FAILURES = 3
"""Errors of the queue in a row, from which it could not recover, after which it gives up."""
_PAUSE = 1.0
"""Time from an error of the queue to the next attempt [s]."""


class JobQueue:
    """Runs jobs one after another and keeps their records.

    Each job has a scratch folder, named in its request, that is deleted at the end of the job;
    results are renamed out of it.

    Args:
        folder: of the records.
        targets: function of each kind of job, as "module:function".
        preload: modules that the worker processes import in advance.
        beside: folders in which a job may hold another scratch folder of its id, and files named
            after it, which are deleted when the job is done; other servers
            may use them, too.
        tidy: is called with all jobs before each one; its text goes into the job's log.
        admit: is called before a job is queued; it raises to refuse the job.
        failed: is called with the reason when the queue cannot go on.
    """

    def __init__(
        self,
        folder: Path,
        targets: Mapping[str, str],
        preload: Iterable[str] = (),
        beside: Iterable[Path] = (),
        tidy: Callable[[list[Job]], str] = lambda jobs: "",
        admit: Callable[[], object] = lambda: None,
        failed: Callable[[str], object] = log.critical,
    ) -> None:
        beside = tuple(beside)
        self._scratch = folder / ".making"
        self._alone = _take(folder)
        shutil.rmtree(self._scratch, ignore_errors=True)
        for place in beside:
            drop_left_behind(place)
        self._records = JobRecords(folder / "jobs.sqlite")
        self._records.interrupt_running("the server ended while this job ran; retry it")
        self._waiting: queue.Queue[str | None] = queue.Queue()
        for job in self._records.waiting():
            self._waiting.put(job.id)
        self._runner = JobRunner(self._records, targets, preload, beside, tidy)
        self._admit = admit
        self._failed, self._stopped, self._put_back = failed, "", set[str]()
        self._thread = threading.Thread(target=self._serve, name="jobs", daemon=True)
        self._thread.start()

    @property
    def version(self) -> int:
        """A number that grows with every change of any record."""
        return self._records.version

    @property
    def trouble(self) -> str:
        """The reason why the queue does not work, or lately did not; empty without any."""
        return self._gone() or self._runner.patience.trouble or self._stopped

    def submit(
        self, kind: str, request: dict[str, Any], label: str = "job", key: str | None = None
    ) -> Job:
        """Queue a job; its id is the label, the time and eight random characters.

        A second request with the same `key` gives the same job; raises Conflict if its content
        differs, and NoSpace where the results take more than they may.
        """
        self.admit(key)
        while True:
            moment = time.strftime("%Y%m%d-%H%M%S")
            identity = f"{label[:LONGEST_LABEL]}-{moment}-{secrets.token_hex(4)}"
            job = Job(
                id=identity,
                kind=kind,
                request={**request, "scratch": str(self._scratch / identity)},
                key=key,
            )
            if self._records.add(job):
                break
            if key is not None and self._records.by_key(key) is not None:
                return self._same(job)
        self._waiting.put(identity)
        return self.get(identity)

    def admit(self, key: str | None = None) -> None:
        """Raise RunError where the records cannot be kept, and NoSpace where the results take more
        than they may, unless a job is known by the key.
        """
        if gone := self._gone():
            raise RunError(gone)
        if not self.knows(key):
            self._admit()

    def knows(self, key: str | None) -> bool:
        """Whether a job was queued with this key."""
        return key is not None and self._records.by_key(key) is not None

    def get(self, identity: str) -> Job:
        """One job."""
        return self._records.get(identity)

    def all(self, most: int = -1, after: int = 0) -> list[Job]:
        """Jobs, the newest first: at most `most` from the `after`-th on, or all."""
        return self._records.all(most, after)

    def count(self) -> int:
        """Number of jobs."""
        return self._records.count()

    def notes(self, identity: str, after: int = 0) -> list[Note]:
        """Lines of a job's log from the `after`-th on."""
        return self._records.notes(identity, after)

    def cancel(self, identity: str) -> Job:
        """Stop a job that waits or runs."""
        job = self.get(identity)
        if job.state.is_finished:
            raise Conflict(
                f"job {identity} is {job.state.value} already", job=identity, state=job.state.value
            )
        try:
            self._runner.finish(identity, JobState.CANCELLED, text="cancelled")
        finally:
            self._runner.stop(identity)
        return self.get(identity)

    def retry(self, identity: str) -> Job:
        """Repeat a job that ended without a result, under its name; sweeps and trainings resume."""
        job = self.get(identity)
        if not self._runner.can_do(job.kind):
            raise Missing(
                f"job {identity} is a {job.kind}, which this version cannot do", job=identity
            )
        self.admit()
        end = time.monotonic() + ENDING
        while identity in self._runner.running and job.state.is_finished and time.monotonic() < end:
            time.sleep(0.02)
        if identity in self._runner.running or not self._records.reopen(identity):
            state = job.state.value
            raise Conflict(
                f"job {identity} is {state}: there is nothing to retry", job=identity, state=state
            )
        self._waiting.put(identity)
        return self.get(identity)

    def close(self) -> None:
        """Interrupt the running job and stop the server's thread; waiting jobs wait for the next
        start.
        """
        self._runner.patience.closing.set()
        self._waiting.put(None)
        for identity in list(self._runner.running):
            error = {
                "kind": "Interrupted",
                "message": "the server was stopped while this job ran; retry it",
                "where": {},
            }
            with contextlib.suppress(NoSpace):  # the next start then finds it running
                self._runner.finish(identity, JobState.INTERRUPTED, error=error, text="interrupted")
            self._runner.stop(identity)
        self._thread.join(timeout=10.0)
        self._records.close()
        self._alone.close()

    def _gone(self) -> str:
        """Why records would be lost, where the folder was moved or deleted; else empty."""
        try:
            there = os.path.samestat(os.stat(self._alone.name), os.fstat(self._alone.fileno()))
        except OSError:
            there = False
        if there:
            return ""
        return (
            f"the folder of runs {Path(self._alone.name).parent} was moved, replaced or deleted "
            "while this server worked in it: put it back, or restart the server"
        )

    def _same(self, job: Job) -> Job:
        known = self._records.by_key(job.key or "")
        if known is None:
            raise Conflict(f"there is a job {job.id} already", job=job.id)
        if (known.kind, _request_of(known)) != (job.kind, _request_of(job)):
            raise Conflict(
                f"the key {job.key} was another request's: job {known.id}",
                key=job.key,
                job=known.id,
            )
        return known

    def _serve(self) -> None:
        """Run waiting jobs. After an error of the queue itself it puts the job back and goes on;
        where that fails several times, it gives up.
        """
        closing, failures = self._runner.patience.closing, 0
        while (identity := self._waiting.get()) is not None and not closing.is_set():
            try:
                job = self.get(identity)
                if job.state is JobState.QUEUED:
                    self._runner.run(job)
                failures, self._stopped = 0, ""
            except Exception as error:  # any one: jobs that wait must not wait for ever
                if closing.is_set():
                    return
                log.exception("the job queue stopped at %s", identity)
                lasting = isinstance(error, RunError)  # the runner has tried several times
                if not lasting and self._recover(identity, f"{type(error).__name__}: {error}"):
                    failures = 0
                    continue
                failures += 1
                if lasting or failures == _FAILURES:
                    self._stopped = str(error)
                    self._failed(f"the job queue gives up: {error}")
                    return
                closing.wait(_PAUSE)
                self._waiting.put(identity)

    def _recover(self, identity: str, text: str) -> bool:
        """Put a job back whose run met an error of the queue; fail it the second time. Returns
        whether that could be written.
        """
        self._stopped = f"the job queue stopped at {identity} ({text}) and was started again"
        write = self._runner.patience.write
        try:
            if identity in self._put_back:
                error = {"kind": "InternalError", "message": text, "where": {}}
                write(self._runner.finish, identity, JobState.FAILED, error=error)
                return True
            write(self._records.put_back, identity)
            note = f"put back, since the queue met {text}"
            write(self._records.note, identity, "warning", note)
        except Exception:  # any one, as above
            log.exception("%s could not be put back", identity)
            return False
        self._put_back.add(identity)
        self._runner.patience.closing.wait(_PAUSE)
        self._waiting.put(identity)
        return True


def _request_of(job: Job) -> dict[str, Any]:
    return {name: value for name, value in job.request.items() if name != "scratch"}


def _take(folder: Path) -> Any:
    """A file that is locked as long as this server lives: two of them would take each other's jobs
    for left behind.
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = (folder / ".server").open("w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise SetupError(
            f"another server works in {folder}: stop it, or choose another folder with --runs",
            key="runs",
        ) from error
    return file
