"""Long tasks as jobs: one queue, one worker process each, progress through a pipe.

The table of records is the queue, so that waiting jobs outlive the server, and jobs that ran when
the server or the worker was killed are known to be interrupted.
"""

from __future__ import annotations

import fcntl
import logging
import queue
import re
import secrets
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

from palpate.app.http_errors import Conflict, Missing
from palpate.app.jobs.job_process import context, stop_group, work
from palpate.app.jobs.job_records import Job, JobRecords, JobState, Note
from palpate.foundation.errors import SetupError

__all__ = ["JobQueue"]

log = logging.getLogger(__name__)
PAUSE = 0.1
"""Least time between two entries of a job's progress [s]; limits writes to the disk."""
_ENDING = 10.0
"""Longest time that a cancelled job's processes may take to end [s]."""
_NUMBERS = re.compile(r"\d+(\.\d+)?")


class JobQueue:
    """Runs jobs one after another and keeps their records.

    Each job has a scratch folder, named in its request, that is deleted at the end of the job;
    results are renamed out of it.

    Args:
        folder: of the records.
        targets: function of each kind of job, as "module:function".
        preload: modules that the worker processes import in advance.
        beside: folders in which a job may have another scratch folder of its id.
        tidy: is called before each job; its text goes into the job's log.
    """

    def __init__(
        self,
        folder: Path,
        targets: Mapping[str, str],
        preload: Iterable[str] = (),
        beside: Iterable[Path] = (),
        tidy: Callable[[], str] = str,
    ) -> None:
        self._targets, self._beside, self._tidy = dict(targets), tuple(beside), tidy
        self._scratch = folder / ".making"
        self._alone = _take(folder)
        for place in (self._scratch, *self._beside):
            shutil.rmtree(place, ignore_errors=True)
        self._records = JobRecords(folder / "jobs.sqlite")
        self._records.interrupt_running("the server ended while this job ran; retry it")
        self._waiting: queue.Queue[str | None] = queue.Queue()
        for job in self._records.waiting():
            self._waiting.put(job.id)
        self._running: dict[str, ForkServerProcess] = {}
        self._lock = threading.Lock()
        self._closing = False
        self._context = context(preload)
        self._thread = threading.Thread(target=self._serve, name="jobs", daemon=True)
        self._thread.start()

    @property
    def version(self) -> int:
        """A number that grows with every change of any record."""
        return self._records.version

    def submit(
        self, kind: str, request: dict[str, Any], label: str = "job", key: str | None = None
    ) -> Job:
        """Queue a job; its id is the label, the time and four random characters.

        A second request with the same `key` gives the same job; raises Conflict if its content
        differs.
        """
        identity = f"{label}-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(2)}"
        job = Job(
            id=identity,
            kind=kind,
            request={**request, "scratch": str(self._scratch / identity)},
            key=key,
        )
        if not self._records.add(job):
            return self._same(job)
        self._waiting.put(identity)
        return self.get(identity)

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
        self._finish(identity, JobState.CANCELLED, text="cancelled")
        self._stop(identity)
        return self.get(identity)

    def retry(self, identity: str) -> Job:
        """Repeat a job that ended without a result, under its name; sweeps and trainings resume."""
        job = self.get(identity)
        if job.kind not in self._targets:
            raise Missing(
                f"job {identity} is a {job.kind}, which this version cannot do", job=identity
            )
        end = time.monotonic() + _ENDING
        while identity in self._running and job.state.is_finished and time.monotonic() < end:
            time.sleep(0.02)
        if identity in self._running or not self._records.reopen(identity):
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
        self._closing = True
        self._waiting.put(None)
        for identity in list(self._running):
            error = {
                "kind": "Interrupted",
                "message": "the server was stopped while this job ran; retry it",
                "where": {},
            }
            self._finish(identity, JobState.INTERRUPTED, error=error, text="interrupted")
            self._stop(identity)
        self._thread.join(timeout=10.0)
        self._records.close()
        self._alone.close()

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
        while (identity := self._waiting.get()) is not None and not self._closing:
            if self.get(identity).state is JobState.QUEUED:
                self._run(identity)

    def _run(self, identity: str) -> None:
        job = self.get(identity)
        if job.kind not in self._targets:
            message = f"this version cannot do a {job.kind}"
            self._finish(
                identity,
                JobState.FAILED,
                error={"kind": "Missing", "message": message, "where": {}},
            )
            return
        if text := self._tidy():
            self._records.note(identity, "info", text)
        scratch = Path(job.request["scratch"])
        scratch.mkdir(parents=True, exist_ok=True)
        ending: tuple[Any, ...] | None = None
        here, there = self._context.Pipe()
        process = self._context.Process(
            target=work, args=(self._targets[job.kind], job.request, there)
        )
        try:
            with self._lock:
                process.start()
                self._running[identity] = process
            there.close()
            self._records.update(
                identity, state=JobState.RUNNING, started=time.time(), text="starting"
            )
            self._records.note(identity, "info", f"started, attempt {job.attempt}")
            if self.get(identity).state.is_finished:
                self._stop(identity)
            ending = self._follow(identity, here)
            process.join(None if ending is None else _ENDING)
        finally:
            self._stop(identity)
            here.close()
            for place in (scratch, *(folder / identity for folder in self._beside)):
                shutil.rmtree(place, ignore_errors=True)
            self._ended(identity, ending, process.exitcode)
            self._running.pop(identity, None)

    def _ended(self, identity: str, ending: tuple[Any, ...] | None, code: int | None) -> None:
        """Close the record with the worker's last message, after its folders are deleted.

        A worker that was killed without a last message interrupted its job.
        """
        if ending is not None and ending[0] == "failed":
            self._finish(identity, JobState.FAILED, error=ending[1])
        elif ending is not None and ending[0] == "cancelled":
            self._finish(identity, JobState.CANCELLED, text="cancelled")
        elif ending is not None:
            self._finish(identity, JobState.DONE, result=ending[1], fraction=1.0, text="done")
        elif code is not None and code < 0:
            name = signal.Signals(-code).name
            message = f"the worker process was ended from outside ({name}); retry it"
            self._finish(
                identity,
                JobState.INTERRUPTED,
                error={"kind": "WorkerDied", "message": message, "where": {}},
            )
        else:
            message = f"the worker process ended with code {code}"
            self._finish(
                identity,
                JobState.FAILED,
                error={"kind": "WorkerDied", "message": message, "where": {}},
            )

    def _follow(self, identity: str, pipe: Connection) -> tuple[Any, ...] | None:
        """Record the worker's messages; returns the last one, or None if the worker died."""
        written, stage = 0.0, ""
        while True:
            try:
                message: tuple[Any, ...] = pipe.recv()
            except (EOFError, OSError):
                return None
            if message[0] == "progress":
                _, fraction, text = message
                if _NUMBERS.sub("#", text) != stage:
                    stage = _NUMBERS.sub("#", text)
                    self._records.note(identity, "info", text)
                elif time.monotonic() - written < PAUSE:
                    continue
                written = time.monotonic()
                self._records.update(identity, fraction=fraction, text=text)
            elif message[0] == "note":
                self._records.note(identity, message[1], message[2])
            else:
                return message

    def _finish(self, identity: str, state: JobState, **values: Any) -> None:
        if self._records.update(identity, state=state, finished=time.time(), **values):
            error = values.get("error") or {}
            self._records.note(
                identity, "error" if error else "info", error.get("message", state.value)
            )

    def _stop(self, identity: str) -> None:
        with self._lock:
            process = self._running.get(identity)
            if process is not None and process.pid is not None:
                if process.is_alive():
                    process.terminate()
                stop_group(process.pid)


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
