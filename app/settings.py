"""Settings of the server, read once from arguments or the environment (PALPATE_...)."""

from __future__ import annotations

import ipaddress
from pathlib import Path

from pydantic_settings import BaseSettings, SettingsConfigDict

from palpate.app.static_files import STATIC_FOLDER

__all__ = ["Settings"]


class Settings(BaseSettings):
    """Folders, address and limits of the server.

    Attributes:
        host: address to listen on.
        port: port to listen on; 0 takes a free one.
        runs: folder of finished diagnoses, one folder each, and of the job records.
        datasets: folder of the datasets; requests reach nothing outside it.
        workers: processes that one diagnosis may use.
        scheduler: address of a dask scheduler whose workers do the replays of sweeps; this machine
            does them if None.
        static: folder of the page's files.
        preload: modules that the worker processes import once, before the first job.
        allow_host: names besides loopback and `host` by which browsers may call the server, for
            example behind a proxy.
        import_from: folders from which datasets may be imported by path. If empty: any folder where
            no login is needed, else none.
        largest_body: bytes of a request.
        largest_upload: bytes of an uploaded archive.
        largest_dataset: bytes of an unpacked dataset.
        disk_limit: bytes of the runs folder beyond which the oldest caches are deleted, and new
            jobs refused where the results alone take more.
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
        """Whether other machines can reach the server, by its address or by a name given to it."""
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
