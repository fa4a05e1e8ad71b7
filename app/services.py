"""The parts of a running server that the endpoints share."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Header
from starlette.requests import HTTPConnection

from palpate.app.http_errors import NoSpace
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import Job
from palpate.app.jobs.whatif_process import FrameSolver, InteractiveSolver
from palpate.app.scene.looks.look_scenes import LookScenes
from palpate.app.scene.manual_registration import ManualRegistrations
from palpate.app.scene.page_session import Sessions
from palpate.app.scene.phantom import Phantoms
from palpate.app.scene.viser_server import SceneListener, ViewerServer
from palpate.app.settings import Settings
from palpate.app.storage.dataset_import import STAGING
from palpate.app.storage.dataset_library import Library
from palpate.app.storage.disk_usage import Disk
from palpate.app.storage.look_store import LookStore
from palpate.app.storage.registration_store import RegistrationStore
from palpate.app.storage.run_store import RunStore
from palpate.app.storage.stored_results import StoredResults

__all__ = ["ONE_WHOLE_READ", "CurrentServices", "IdempotencyKey", "Services"]


@dataclass(frozen=True)
class Services:
    """The parts of a running server.

    Attributes:
        arriving: files of uploads that no job names yet.
        whole_read: held by the request that reads a whole dataset, so that only one does.
    """

    settings: Settings
    library: Library
    runs: RunStore
    jobs: JobQueue
    disk: Disk
    sessions: Sessions
    viewer: ViewerServer
    manual_registrations: ManualRegistrations
    look_scenes: LookScenes
    frame_solver: FrameSolver
    interactive_solver: InteractiveSolver
    arriving: list[str]
    whole_read: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(1))

    @classmethod
    def open(
        cls, settings: Settings, targets: dict[str, str], failed: Callable[[str], object]
    ) -> Services:
        """Start the job queue and the inner viewer; `failed` is called where the queue gives up."""
        runs = RunStore(settings.runs)
        sessions, library = Sessions(runs), Library(settings.datasets)
        manual_registrations, disk = (
            ManualRegistrations(Phantoms(library).open),
            Disk(settings.runs, settings.disk_limit),
        )
        look_scenes, arriving = LookScenes(LookStore(settings.runs)), list[str]()
        return cls(
            settings=settings,
            library=library,
            runs=runs,
            jobs=JobQueue(
                settings.runs,
                targets,
                settings.preload,
                [settings.datasets / STAGING],
                lambda jobs: _tidy(disk, jobs, arriving),
                lambda: _admit(disk, settings.runs),
                failed,
            ),
            disk=disk,
            sessions=sessions,
            viewer=ViewerServer(
                SceneListener(sessions.join, sessions.leave),
                SceneListener(look_scenes.join, look_scenes.leave),
                SceneListener(manual_registrations.join, manual_registrations.leave),
                manual_registrations.click,
            ),
            manual_registrations=manual_registrations,
            look_scenes=look_scenes,
            frame_solver=FrameSolver(),
            interactive_solver=InteractiveSolver(),
            arriving=arriving,
        )

    def diagnose(
        self,
        dataset: Path,
        name: str,
        seed: int,
        key: str | None = None,
        registration: str | None = None,
        tolerance: float | None = None,
    ) -> Job:
        """Queue the diagnosis of a dataset folder, with an accepted registration if named; the id
        of the job will be the run's. `tolerance` [m] as of `palpate.diagnosis.pipeline.diagnose`.
        """
        places = {"dataset": str(dataset), "runs": str(self.settings.runs)}
        request = {
            **places,
            "name": name,
            "workers": self.settings.workers,
            "seed": seed,
            **({} if tolerance is None else {"tolerance": tolerance}),
            **self.registered(name, registration),
        }
        return self.jobs.submit("diagnosis", request, name, key)

    def registered(self, dataset: str, registration: str | None) -> dict[str, Any]:
        """The part of a job's request that has an accepted registration: all of it, so that later
        changes do not affect the job.
        """
        if registration is None:
            return {}
        accepted = RegistrationStore(self.settings.runs, dataset).accepted(registration)
        accepted.check(self.library.path(dataset))
        return {"registration": accepted.to_json()}

    def awaited(self) -> frozenset[str]:
        """Archives that uploads and imports may still need."""
        return _awaited(self.jobs.all(), self.arriving)

    def is_awaited(self, archive: Path) -> bool:
        """Whether an import, or another upload than the caller's, needs an archive."""
        others = list(self.arriving)
        others.remove(str(archive))
        return str(archive) in _awaited(self.jobs.all(), others)

    def close(self) -> None:
        """Cancel the running job and stop the inner viewer."""
        self.jobs.close()
        self.viewer.close()
        self.frame_solver.close()
        self.interactive_solver.close()


def _awaited(jobs: Iterable[Job], arriving: Iterable[str]) -> frozenset[str]:
    needing = [
        job
        for job in jobs
        if job.kind in ("import", "look")
        and (job.state.can_be_retried or not job.state.is_finished)
    ]
    files = (
        str(file)
        for job in needing
        for file in (job.request.get("archive"), *job.request.get("uploads", ()))
    )
    return frozenset([*arriving, *files])


def _tidy(disk: Disk, jobs: Iterable[Job], arriving: Iterable[str]) -> str:
    """Delete old caches if necessary, but no archive that may still be needed; returns a text for
    the log, empty where there is nothing to say.
    """
    now = disk.trim(spared=_awaited(jobs, arriving))
    return f"dropped {now.dropped / 2**20:.0f} MiB of the oldest caches" if now.dropped else ""


def _admit(disk: Disk, runs: Path) -> None:
    """Raise NoSpace where the results alone take more than the limit, and name the largest."""
    now = disk.usage()
    if now.used - now.caches <= now.limit:
        return
    largest = [
        f"{one.kind} {one.name} ({one.bytes / 2**30:.2f} GiB)"
        for one in StoredResults(runs).largest(3)
    ]
    first = f", first of all {', '.join(largest)}" if largest else ""
    raise NoSpace(
        f"the results take {(now.used - now.caches) / 2**30:.2f} GiB of the "
        f"{now.limit / 2**30:.2f} GiB that they may: delete what is no longer needed (Jobs on the "
        f"page, or DELETE /api/disk/KIND/NAME){first}; or start the server with a larger "
        "--disk-limit"
    )


def _services(connection: HTTPConnection) -> Services:
    services: Services = connection.app.state.services
    return services


CurrentServices = Annotated[Services, Depends(_services)]


async def _one_whole_read(services: CurrentServices) -> AsyncIterator[None]:
    """Let one request at a time go on; the others wait without taking a thread."""
    async with services.whole_read:
        yield


ONE_WHOLE_READ = Depends(_one_whole_read)
"""Dependency of endpoints that read a whole dataset: the memory of several would add up."""

IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="A name for this request: a repeated request with the same name and body "
        "gets the existing job.",
    ),
]
