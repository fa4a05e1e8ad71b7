"""Everything the endpoints share, made once per server."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Header
from starlette.requests import HTTPConnection

from palpate.app.jobs.job_queue import Jobs
from palpate.app.jobs.job_records import Job
from palpate.app.jobs.whatif_process import Lives, WhatIfs
from palpate.app.scene.manual_registration import Clickings
from palpate.app.scene.page_session import Sessions
from palpate.app.scene.viser_server import Audience, Stage
from palpate.app.settings import Settings
from palpate.app.storage.dataset_import import STAGING
from palpate.app.storage.dataset_library import Library
from palpate.app.storage.disk_usage import Disk
from palpate.app.storage.registration_store import Registrations
from palpate.app.storage.run_store import Runs

__all__ = ["Desk", "DeskOf", "KeyOf"]


@dataclass(frozen=True)
class Desk:
    """The parts of a running server."""

    settings: Settings
    library: Library
    runs: Runs
    jobs: Jobs
    disk: Disk
    sessions: Sessions
    stage: Stage
    clickings: Clickings
    whatifs: WhatIfs
    lives: Lives

    @classmethod
    def open(cls, settings: Settings, targets: dict[str, str]) -> Desk:
        """Start the job queue and the inner viewer."""
        runs = Runs(settings.runs)
        sessions, library = Sessions(runs), Library(settings.datasets)
        clickings, disk = Clickings(library.phantom), Disk(settings.runs, settings.disk_limit)
        return cls(
            settings=settings,
            library=library,
            runs=runs,
            jobs=Jobs(
                settings.runs,
                targets,
                settings.preload,
                [settings.datasets / STAGING],
                lambda: _tidied(disk),
            ),
            disk=disk,
            sessions=sessions,
            stage=Stage(
                Audience(sessions.join, sessions.leave),
                Audience(clickings.join, clickings.leave),
                clickings.click,
            ),
            clickings=clickings,
            whatifs=WhatIfs(),
            lives=Lives(),
        )

    def diagnose(
        self,
        dataset: Path,
        name: str,
        seed: int,
        key: str | None = None,
        registration: str | None = None,
    ) -> Job:
        """Queue the diagnosis of a dataset folder, with an accepted registration if named; the
        job's id will be the run's.
        """
        places = {"dataset": str(dataset), "runs": str(self.settings.runs)}
        request = {
            **places,
            "name": name,
            "workers": self.settings.workers,
            "seed": seed,
            **self.registered(name, registration),
        }
        return self.jobs.submit("diagnosis", request, name, key)

    def registered(self, dataset: str, registration: str | None) -> dict[str, Any]:
        """What a job's request says of an accepted registration: all of it, so that the job means
        the same whenever it is done.
        """
        if registration is None:
            return {}
        accepted = Registrations(self.settings.runs).accepted(dataset, registration)
        accepted.check(self.library.path(dataset))
        return {"registration": accepted.to_json()}

    def awaited(self) -> frozenset[str]:
        """Archives that imports may still need."""
        jobs = [
            job
            for job in self.jobs.all()
            if job.kind == "import" and (job.state.can_be_retried or not job.state.is_finished)
        ]
        return frozenset(str(job.request.get("archive")) for job in jobs)

    def close(self) -> None:
        """Cancel what runs and stop the inner viewer."""
        self.jobs.close()
        self.stage.close()
        self.whatifs.close()
        self.lives.close()


def _tidied(disk: Disk) -> str:
    """Make room if need be, and say so."""
    now = disk.trim()
    if now.used > now.limit:
        return f"the results take {now.used / 2**30:.1f} GiB of {now.limit / 2**30:.1f} GiB: delete some of them"
    return f"dropped {now.dropped / 2**20:.0f} MiB of the oldest caches" if now.dropped else ""


def _desk(connection: HTTPConnection) -> Desk:
    desk: Desk = connection.app.state.desk
    return desk


DeskOf = Annotated[Desk, Depends(_desk)]

KeyOf = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="A name for this request: the same one again, with the same body, answers with the job that is there.",
    ),
]
