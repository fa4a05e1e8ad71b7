"""One frozen description of how the server runs, read once from arguments or the environment
(PALPATE_...).
"""

from __future__ import annotations

import ipaddress
from pathlib import Path

from pydantic_settings import BaseSettings, SettingsConfigDict

from palpate.app.static_files import STATIC_FOLDER

__all__ = ["Settings"]


class Settings(BaseSettings):
    """Where data and results lie and where the page is served.

    Attributes:
        runs: folder of finished diagnoses, one folder each; the job records lie beside them.
        datasets: folder below which the datasets lie; nothing outside it is reachable from the
            page.
        workers: processes that one diagnosis may use.
        scheduler: address of a dask scheduler whose workers do the replays of sweeps; this machine
            does them without.
        preload: modules that the worker processes import once, before the first job.
        allow_host: names besides loopback and `host` by which browsers may call the server, for
            example behind a proxy.
        import_from: folders below which those lie that may be imported by their path; without any,
            every folder where only this machine's own users reach the server, and none where others
            do.
        largest_body: bytes that a request may bring.
        largest_upload: the same for an archive that is imported.
        largest_dataset: bytes that a dataset may have, unpacked.
        disk_limit: bytes of the runs folder beyond which the oldest caches are dropped.
    """

    model_config = SettingsConfigDict(env_prefix="PALPATE_", frozen=True)

    host: str = "127.0.0.1"
    port: int = 8321
    runs: Path = Path("runs")
    datasets: Path = Path("datasets")
    workers: int = 2
    scheduler: str | None = None
    static: Path = STATIC_FOLDER
    preload: tuple[str, ...] = (
        "palpate.app.jobs.tasks",
        "palpate.dataset",
        "palpate.diagnosis.pipeline",
    )
    allow_host: tuple[str, ...] = ()
    import_from: tuple[Path, ...] = ()
    largest_body: int = 2**20
    largest_upload: int = 4 * 2**30
    largest_dataset: int = 16 * 2**30
    disk_limit: int = 20 * 2**30

    @property
    def needs_login(self) -> bool:
        """Whether others than this machine's own users can reach the server, by its address or by a
        name given to it.
        """
        return not all(map(_is_loopback, (self.host, *self.allow_host)))

    @property
    def import_roots(self) -> tuple[Path, ...] | None:
        """Folders below which imports by path may lie; None for any."""
        return self.import_from if self.import_from or self.needs_login else None


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
