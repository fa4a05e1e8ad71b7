"""One frozen description of how the server runs, read once from arguments or the environment (PALPATE_...)."""

from __future__ import annotations

import ipaddress
from pathlib import Path

from pydantic_settings import BaseSettings, SettingsConfigDict

from core.errors import SetupError

__all__ = ["Settings", "require_loopback"]


class Settings(BaseSettings):
    """Where data and results lie and where the page is served.

    Attributes:
        runs: folder of finished diagnoses, one folder each; the job records lie beside them.
        datasets: folder below which the datasets lie; nothing outside it is reachable from the page.
        workers: processes that one diagnosis may use.
        preload: modules that the worker processes import once, before the first job.
    """

    model_config = SettingsConfigDict(env_prefix="PALPATE_", frozen=True)

    host: str = "127.0.0.1"
    port: int = 8321
    runs: Path = Path("runs")
    datasets: Path = Path("datasets")
    workers: int = 2
    static: Path = Path(__file__).resolve().parent.parent / "static"
    preload: tuple[str, ...] = ("app.work", "core.dataset", "core.diagnosis")


def require_loopback(host: str) -> None:
    """Refuse every address that other machines could reach: the page has no login."""
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise SetupError(
            f"host {host} can be reached from other machines, and the page has no login yet; "
            "use 127.0.0.1 and forward the port, for example with ssh -L 8321:127.0.0.1:8321",
            key="host",
            value=host,
        )
