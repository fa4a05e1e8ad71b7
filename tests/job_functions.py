"""Functions of test jobs that end, wait, warn, fail or die, and functions that wait for them."""

from __future__ import annotations

import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import Job
from palpate.foundation.errors import Cancelled, DatasetError
from palpate.foundation.progress import Report

__all__ = ["TARGETS", "alive", "ended", "family", "gone", "reached", "scratch_is_clean"]

Request = dict[str, Any]


def count(request: Request, report: Report) -> Request:
    """Run for a number of steps; write the process id to RESULT.pid, and rename the finished
    folder.
    """
    pathlib.Path(request["result"] + ".pid").write_text(str(os.getpid()))
    for step in range(request["steps"]):
        report(step / request["steps"], f"step {step}")
        pathlib.Path(request["scratch"], f"{step}.part").write_text("half")
        time.sleep(request.get("pause", 0))
    os.rename(request["scratch"], request["result"])
    return {"steps": request["steps"]}


def sleep_with_child(request: Request, report: Report) -> Request:
    """Sleep for a minute with a child process."""
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as child:
        pathlib.Path(request["result"]).write_text(f"{os.getpid()} {child.pid}")
        report(0.5, "sleeping")
        time.sleep(60)
    return {}


def refuse(request: Request, report: Report) -> Request:
    """Raise an error of the data."""
    raise DatasetError("touches.csv, row 3: nan", file="touches.csv", row=3)


def stumble(request: Request, report: Report) -> Request:
    """Raise an internal error."""
    raise ZeroDivisionError("a bug")


def lose(request: Request, report: Report) -> Request:
    """Meet the end of a process of its own, as a write to it does."""
    raise BrokenPipeError(32, "Broken pipe")


def give_up(request: Request, report: Report) -> Request:
    """Raise Cancelled."""
    raise Cancelled


def warn(request: Request, report: Report) -> Request:
    """Report frames, a warning, and another stage."""
    for step in range(30):
        report(step / 30, f"frame {step} of 30")
    warnings.warn("cloud 7 is dark", stacklevel=1)
    report(0.9, "writing")
    return {}


def linger(request: Request, report: Report) -> Request:
    """Run until the runs folder has a file called go."""
    warnings.warn("cloud 7 is dark", stacklevel=1)
    for step in range(10_000):
        report(min(0.05 + step / 1000, 0.9), f"frame {step}")
        if pathlib.Path(request["runs"], "go").exists():
            break
        time.sleep(0.05)
    return {}


def litter(request: Request, report: Report) -> Request:
    """Make a folder beside the others, and die the first time."""
    place = pathlib.Path(request["beside"], pathlib.Path(request["scratch"]).name)
    place.mkdir(parents=True)
    (place / "half").write_text("half")
    if not pathlib.Path(request["again"]).exists():
        pathlib.Path(request["again"]).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {}


def die(request: Request, report: Report) -> Request:
    """Exit without a last message."""
    os._exit(7)


TARGETS = {
    work.__name__: f"job_functions:{work.__name__}"
    for work in (count, sleep_with_child, refuse, stumble, lose, give_up, warn, litter, die)
}


def ended(jobs: JobQueue, job: Job) -> Job:
    """The job once it has ended."""
    return reached(jobs, job, lambda now: now.state.is_finished)


def reached(jobs: JobQueue, job: Job, true: Callable[[Job], bool]) -> Job:
    """The job once a condition holds."""
    end = time.monotonic() + 120
    while not true(now := jobs.get(job.id)):
        assert time.monotonic() < end, f"still {now}"
        time.sleep(0.02)
    return now


def alive(pid: int) -> bool:
    """Whether a process runs."""
    try:
        state = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def family(pid: int) -> list[int]:
    """Ids of all descendants of a process."""
    found: list[int] = []
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):  # a thread that has ended meanwhile
            for child in map(int, task.read_text().split()):
                found += [child, *family(child)]
    return found


def gone(pids: list[int], seconds: float = 30.0) -> bool:
    """Whether all these processes end in time."""
    end = time.monotonic() + seconds
    while any(alive(pid) for pid in pids) and time.monotonic() < end:
        time.sleep(0.02)
    return not any(alive(pid) for pid in pids)


def scratch_is_clean(folder: pathlib.Path) -> bool:
    """Whether no job has left a scratch folder."""
    return not any((folder / ".making").glob("*"))
