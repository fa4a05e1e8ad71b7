"""Runs one job in a process of its own and keeps its record."""

from __future__ import annotations

import contextlib
import errno
import logging
import re
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

from palpate.app.http_errors import NoSpace
from palpate.app.jobs.full_disk import PatientWriter
from palpate.app.jobs.job_process import context, stop_group, work
from palpate.app.jobs.job_records import Job, JobRecords, JobState
from palpate.foundation.errors import RunError

__all__ = ["ENDING", "JobRunner"]

log = logging.getLogger(__name__)
PAUSE = 0.1
"""Least time between two entries of a job's progress [s]; limits writes to the disk."""
ENDING = 10.0
"""Longest time that the processes of an ended job may take to end [s]."""
_PAUSES = (0.2, 1.0, 5.0)
"""Times before a job's process is started again, where the fork server has ended [s]: until the
system has cleared a server that was killed, it counts as running and refuses connections."""
_FILES = 1.0
"""Time between two attempts while the server may open no more files [s]."""
_NUMBERS = re.compile(r"\d+(\.\d+)?")


class JobRunner:
    """Runs jobs, one at a time.

    Args:
        records: of the jobs.
        targets: and all further arguments: as of `JobQueue`.

    Attributes:
        patience: waits for room where the disk is full.
        running: process of each job that runs.
    """

    def __init__(
        self,
        records: JobRecords,
        targets: Mapping[str, str],
        preload: Iterable[str],
        beside: Iterable[Path],
        tidy: Callable[[list[Job]], str],
    ) -> None:
        self._records, self._targets = records, dict(targets)
        self._beside, self._tidy = tuple(beside), tidy
        self._context = context(preload)
        self._lock = threading.Lock()
        self.patience = PatientWriter()
        self.running: dict[str, ForkServerProcess] = {}
        self._began: dict[str, float] = {}

    def can_do(self, kind: str) -> bool:
        """Whether this version has a function for a kind of job."""
        return kind in self._targets

    def run(self, job: Job) -> None:
        """Run a job to its end.

        Raises:
            RunError: no process can be started; the job is as before.
            NoSpace: the disk is full, and nothing waits for room any longer.
        """
        identity, write = job.id, self.patience.write
        if not self.can_do(job.kind):
            message = f"this version cannot do a {job.kind}"
            error = {"kind": "Missing", "message": message, "where": {}}
            write(self.finish, identity, JobState.FAILED, error=error)
            return
        if text := self._tidy(self._records.all()):
            write(self._records.note, identity, "info", text)
        scratch = Path(job.request["scratch"])
        write(scratch.mkdir, parents=True, exist_ok=True)
        process, here = self._started(job)
        self._began[identity] = time.monotonic()
        try:
            started = {"state": JobState.RUNNING, "started": time.time(), "text": "starting"}
            write(self._records.update, identity, **started)
            write(self._records.note, identity, "info", f"started, attempt {job.attempt}")
            if self._records.get(identity).state.is_finished:
                self.stop(identity)
            ending = self._follow(identity, here)
            process.join(None if ending is None else ENDING)
        finally:
            self.stop(identity)
            here.close()
            for place in (scratch, *(folder / identity for folder in self._beside)):
                shutil.rmtree(place, ignore_errors=True)
            self.running.pop(identity, None)
        write(self._ended, identity, ending, process.exitcode)
        if self._records.get(identity).state is JobState.DONE:
            for folder in self._beside:
                for note in folder.glob(f"{identity}.*"):
                    note.unlink(missing_ok=True)
        self._began.pop(identity, None)

    def finish(self, identity: str, state: JobState, **values: Any) -> None:
        """Close a job's record, unless it is closed."""
        ended = {"state": state, "finished": time.time(), "seconds": self._seconds(identity)}
        if self._records.update(identity, **ended, **values):
            error = values.get("error") or {}
            text = error.get("message", state.value)
            with contextlib.suppress(NoSpace):  # the record has it, too
                self._records.note(identity, "error" if error else "info", text)

    def _seconds(self, identity: str) -> float:
        """How long a job's process has run [s]; 0 where it has not begun."""
        now = time.monotonic()
        return now - self._began.get(identity, now)

    def stop(self, identity: str) -> None:
        """End a job's processes."""
        with self._lock:
            process = self.running.get(identity)
            if process is not None and process.pid is not None:
                if process.is_alive():
                    process.terminate()
                stop_group(process.pid)

    def _started(self, job: Job) -> tuple[ForkServerProcess, Connection]:
        """Start a job's process; return it and the pipe of its messages.

        A fork server that has ended is started again. Raises RunError where that does not help, or
        the server is closing.
        """
        pauses = list(_PAUSES)
        while True:
            try:
                started = self._process(job)
            except (EOFError, OSError) as error:
                if not pauses or self.patience.closing.is_set():
                    raise RunError(
                        f"no process could be started for {job.id} in {1 + len(_PAUSES)} attempts "
                        f"({type(error).__name__}: {error}); it waits for the next start of the "
                        "server",
                        job=job.id,
                    ) from error
                self._pause(job, error, pauses)
            else:
                self.patience.trouble = ""
                return started

    def _pause(self, job: Job, error: Exception, pauses: list[float]) -> None:
        """Wait until a job's process may start: the next pause, or while files run out as long as
        it takes.
        """
        if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
            self.patience.trouble = (
                "the server has too many open files and connections to start a job's process; "
                "jobs go on when some are closed"
            )
            self.patience.closing.wait(_FILES)
            return
        text = f"its process did not start ({type(error).__name__}); started again"
        log.warning("%s: %s", job.id, text)
        self.patience.write(self._records.note, job.id, "warning", text)
        self.patience.closing.wait(pauses.pop(0))

    def _process(self, job: Job) -> tuple[ForkServerProcess, Connection]:
        here, there = self._context.Pipe()
        with there:
            target = self._targets[job.kind]
            process = self._context.Process(target=work, args=(target, job.request, there))
            try:
                with self._lock:
                    process.start()
                    self.running[job.id] = process
            except BaseException:
                here.close()
                raise
        return process, here

    def _follow(self, identity: str, pipe: Connection) -> tuple[Any, ...] | None:
        """Record the worker's messages; returns the last one, or None if the worker died."""
        written, stage, write = 0.0, "", self.patience.write
        while True:
            try:
                message: tuple[Any, ...] = pipe.recv()
            except (EOFError, OSError):
                return None
            if message[0] == "progress":
                _, fraction, text = message
                if _NUMBERS.sub("#", text) != stage:
                    stage = _NUMBERS.sub("#", text)
                    write(self._records.note, identity, "info", text)
                elif time.monotonic() - written < PAUSE:
                    continue
                written = time.monotonic()
                values = {"fraction": fraction, "text": text, "seconds": self._seconds(identity)}
                write(self._records.update, identity, **values)
            elif message[0] == "note":
                write(self._records.note, identity, message[1], message[2])
            else:
                return message

    def _ended(self, identity: str, ending: tuple[Any, ...] | None, code: int | None) -> None:
        """Close the record with the worker's last message, after its folders are deleted.

        A worker that was killed without a last message interrupted its job.
        """
        if ending is not None and ending[0] == "failed":
            self.finish(identity, JobState.FAILED, error=ending[1])
        elif ending is not None and ending[0] == "cancelled":
            self.finish(identity, JobState.CANCELLED, text="cancelled")
        elif ending is not None:
            self.finish(identity, JobState.DONE, result=ending[1], fraction=1.0, text="done")
        elif code is not None and code < 0:
            name = signal.Signals(-code).name
            message = f"the worker process was ended from outside ({name}); retry it"
            error = {"kind": "WorkerDied", "message": message, "where": {}}
            self.finish(identity, JobState.INTERRUPTED, error=error)
        else:
            message = f"the worker process ended with code {code}"
            error = {"kind": "WorkerDied", "message": message, "where": {}}
            self.finish(identity, JobState.FAILED, error=error)
