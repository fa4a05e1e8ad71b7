"""Long verbs as jobs: one queue, one worker process each, progress through a pipe, cancel = terminate."""

from __future__ import annotations

import logging
import queue
import secrets
import shutil
import threading
import time
from collections.abc import Iterable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

from app.problems import Conflict
from app.records import Job, JobState, Records
from app.worker import context, stop_group, work

__all__ = ["Jobs"]

log = logging.getLogger(__name__)


class Jobs:
    """Runs jobs one after another and keeps their records.

    Each job has a scratch folder, named in its request, that is gone when the job has ended, however it ended: a result
    is what the work renamed out of it.
    """

    def __init__(self, folder: Path, targets: Mapping[str, str], preload: Iterable[str] = ()) -> None:
        self._targets = dict(targets)
        self._scratch = folder / ".making"
        shutil.rmtree(self._scratch, ignore_errors=True)
        self._records = Records(folder / "jobs.sqlite")
        self._records.fail_unfinished("the server ended while this job was open; start it again")
        self._waiting: queue.Queue[str | None] = queue.Queue()
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

    def submit(self, kind: str, request: dict[str, Any], label: str = "job") -> Job:
        """Queue a job; its id is the label, the time and four random characters."""
        identity = f"{label}-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(2)}"
        job = Job(id=identity, kind=kind, request={**request, "scratch": str(self._scratch / identity)})
        self._records.add(job)
        self._waiting.put(identity)
        return self.get(identity)

    def get(self, identity: str) -> Job:
        """One job."""
        return self._records.get(identity)

    def all(self) -> list[Job]:
        """All jobs, the newest first."""
        return self._records.all()

    def cancel(self, identity: str) -> Job:
        """Stop a job that waits or runs."""
        job = self.get(identity)
        if job.state.is_finished:
            raise Conflict(f"job {identity} is {job.state.value} already", job=identity, state=job.state.value)
        self._finish(identity, JobState.CANCELLED, text="cancelled")
        self._stop(identity)
        return self.get(identity)

    def close(self) -> None:
        """End the server's jobs: the running one is cancelled, those that wait are failed at the next start."""
        self._closing = True
        self._waiting.put(None)
        for identity in list(self._running):
            self._finish(identity, JobState.CANCELLED, text="the server was stopped")
            self._stop(identity)
        self._thread.join(timeout=10.0)
        self._records.close()

    def _serve(self) -> None:
        while (identity := self._waiting.get()) is not None and not self._closing:
            if not self.get(identity).state.is_finished:
                self._run(identity)

    def _run(self, identity: str) -> None:
        job = self.get(identity)
        scratch = Path(job.request["scratch"])
        scratch.mkdir(parents=True, exist_ok=True)
        here, there = self._context.Pipe()
        process = self._context.Process(target=work, args=(self._targets[job.kind], job.request, there))
        try:
            with self._lock:
                process.start()
                self._running[identity] = process
            there.close()
            self._records.update(identity, state=JobState.RUNNING, started=time.time(), text="starting")
            if self.get(identity).state.is_finished:
                self._stop(identity)
            self._follow(identity, here)
            process.join()
        finally:
            self._stop(identity)
            self._running.pop(identity, None)
            here.close()
            shutil.rmtree(scratch, ignore_errors=True)
        self._finish(
            identity,
            JobState.FAILED,
            error={"kind": "WorkerDied", "message": f"the worker process ended with code {process.exitcode}", "where": {}},
        )

    def _follow(self, identity: str, pipe: Connection) -> None:
        while True:
            try:
                message = pipe.recv()
            except (EOFError, OSError):
                return
            if message[0] == "progress":
                self._records.update(identity, fraction=message[1], text=message[2])
            elif message[0] == "failed":
                self._finish(identity, JobState.FAILED, error=message[1])
            elif message[0] == "cancelled":
                self._finish(identity, JobState.CANCELLED, text="cancelled")
            else:
                self._finish(identity, JobState.DONE, result=message[1], fraction=1.0, text="done")

    def _finish(self, identity: str, state: JobState, **values: Any) -> None:
        self._records.update(identity, state=state, finished=time.time(), **values)

    def _stop(self, identity: str) -> None:
        with self._lock:
            process = self._running.get(identity)
            if process is not None and process.pid is not None:
                if process.is_alive():
                    process.terminate()
                stop_group(process.pid)
