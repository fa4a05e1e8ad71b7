"""The process of one job, which reports its progress through a pipe. Imports nothing heavy."""

from __future__ import annotations

import contextlib
import importlib
import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from typing import Any

from palpate.app.http_errors import NoSpace, as_dict, disk_is_full
from palpate.foundation.errors import Cancelled, PalpateError, RunError
from palpate.foundation.progress import Report

__all__ = ["Work", "context", "stop_group", "work"]

_LOST = (
    "a process that this job had started was ended from outside (killed, or out of memory): retry "
    "the job"
)
Work = Callable[[dict[str, Any], Report], dict[str, Any]]
log = logging.getLogger(__name__)


def context(preload: Iterable[str]) -> ForkServerContext:
    """The start method of all jobs: a fork server that has imported `preload`."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    method = multiprocessing.get_context("forkserver")
    method.set_forkserver_preload(list(preload))
    forkserver.ensure_running()
    return method


def work(target: str, request: dict[str, Any], pipe: Connection) -> None:
    """Do one job: `target` is "module:function". Its result or its error is the last message in the
    pipe.
    """
    os.setpgid(0, 0)
    with contextlib.suppress(OSError):
        os.nice(5)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(pipe,), daemon=True).start()

    tell = _voice(pipe)

    def report(fraction: float, text: str) -> None:
        tell("progress", float(fraction), text)

    logging.captureWarnings(True)
    logging.getLogger().addHandler(_ToLog(tell))
    tell(*_outcome(target, request, report))


class _ToLog(logging.Handler):
    """Sends warnings of libraries and of our own code to the job's log."""

    def __init__(self, tell: Callable[..., None]) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell

    def emit(self, record: logging.LogRecord) -> None:
        """Send one line."""
        level = "error" if record.levelno >= logging.ERROR else "warning"
        with contextlib.suppress(OSError):
            self._tell("note", level, self.format(record))


def _voice(pipe: Connection) -> Callable[..., None]:
    """A function that sends messages from any thread, one at a time."""
    one = threading.Lock()

    def tell(*message: Any) -> None:
        with one:
            pipe.send(message)

    return tell


def _outcome(target: str, request: dict[str, Any], report: Report) -> tuple[str, dict[str, Any]]:
    try:
        module, name = target.split(":")
        function: Work = getattr(importlib.import_module(module), name)
        return "done", function(request, report)
    except PalpateError as error:
        return "failed", as_dict(error)
    except Cancelled:
        return "cancelled", {}
    except Exception as error:
        if disk_is_full(error):
            return "failed", as_dict(NoSpace())
        if isinstance(error, (ConnectionError, EOFError, BrokenExecutor)):
            log.exception("job %s lost a process", target)
            return "failed", as_dict(RunError(_LOST))
        log.exception("job %s stopped", target)
        return "failed", {
            "kind": "InternalError",
            "message": f"{type(error).__name__}: {error}",
            "where": {},
        }


def _end_with_parent(pipe: Connection) -> None:
    """End this process and its children when the server is gone. The server never sends anything,
    so any end of the pipe is its end.
    """
    with contextlib.suppress(EOFError, OSError):
        pipe.recv()
    stop_group(os.getpid())


def stop_group(pid: int) -> None:
    """Terminate a job's process together with the processes it started."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGTERM)
