"""Results of one kind together with the jobs that make them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from palpate.app.http_errors import Missing
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import Job
from palpate.app.schemas import JobOut
from palpate.app.storage.dataset_library import Library
from palpate.app.storage.result_store import DAMAGED, ResultStore

__all__ = ["cancel_job", "job_of", "job_out", "listed_result", "names_and_jobs", "result_and_job"]


def job_out(job: Job) -> JobOut:
    """The public part of a job record."""
    names = [name for name in JobOut.model_fields if name not in ("dataset", "can_retry")]
    return JobOut(
        dataset=job.request.get("name"),
        can_retry=job.state.can_be_retried,
        **{name: getattr(job, name) for name in names},
    )


def names_and_jobs(store: ResultStore, jobs: JobQueue) -> list[tuple[str, dict[str, Any] | None]]:
    """Names of all results, the newest first, with their jobs where these are still recorded.

    Results whose jobs have not begun to write come first.
    """
    public = {job.id: job_out(job) for job in jobs.all() if job.kind == store.kind}
    begun = store.names()
    names = [*(name for name in public if name not in begun), *begun]
    return [(name, public[name].model_dump() if name in public else None) for name in names]


def result_and_job(
    store: ResultStore, name: str, job: dict[str, Any] | None, library: Library
) -> dict[str, Any]:
    """One result as REST answers it: its job, the request, the summary once it is finished, and
    whether the data have changed since; null where that is not known.

    Raises Missing where there is neither a job nor a folder.
    """
    begun = store.has_begun(name)
    if job is None and not begun:
        raise store.missing(name)
    has_request = begun and store.first != store.last
    request = store.request(name) if has_request else None
    summary = store.result(name) if begun else None
    stated = {**(request or {}), **(summary or {})}
    folder = Path(str(stated.get("folder") or stated.get("dataset"))).name
    return {
        "id": name,
        "job": job,
        "request": request,
        "summary": summary,
        "data_changed": library.data_changed(folder, stated.get("made_from") or {}),
    }


def listed_result(
    store: ResultStore, name: str, job: dict[str, Any] | None, library: Library
) -> dict[str, Any]:
    """One result in a list; the content of a damaged file is left out."""
    try:
        return result_and_job(store, name, job, library)
    except DAMAGED:
        empty = dict.fromkeys(("request", "summary", "data_changed"))
        return {"id": name, "job": job, **empty}


def job_of(store: ResultStore, name: str, jobs: JobQueue) -> dict[str, Any] | None:
    """The job of a result; None where it is not recorded."""
    try:
        job = jobs.get(name)
    except Missing:
        return None
    return job_out(job).model_dump() if job.kind == store.kind else None


def cancel_job(store: ResultStore, name: str, jobs: JobQueue) -> JobOut:
    """Stop the job of a result."""
    if job_of(store, name, jobs) is None:
        raise Missing(f"there is no {store.kind} {name} to stop", **{store.kind: name})
    return job_out(jobs.cancel(name))
