"""Diagnostics for the report of a fault: versions, machine, settings, log, last jobs.

It contains no file of a dataset, no token and no result. Names of datasets and folders are in it,
and so is a single value that an error message quotes.
"""

from __future__ import annotations

import json
import logging
import os
import platform
import shutil
import sqlite3
import sys
import time
from collections.abc import Iterator
from importlib import metadata
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Any

from palpate.dataset.provenance import software_of

__all__ = ["LOG", "diagnostics", "note_settings", "noted_settings", "write_log"]

LOG = "server.log"
"""File of the server's log, below the runs; older parts have a number behind the name."""
_SETTINGS = "server.json"
"""File of the settings that a server was started with last, below the runs."""
_LARGEST, _PARTS = 2**20, 4
_PACKAGES = "palpate viser fastapi uvicorn torch open3d trimesh numpy scipy numba".split()
_LINES, _JOBS, _NOTES = 400, 10, 15


def write_log(runs: Path) -> None:
    """Let this process log warnings also into the folder of runs, in five parts of a megabyte."""
    handler = RotatingFileHandler(
        runs / LOG, maxBytes=_LARGEST, backupCount=_PARTS, encoding="utf-8", delay=True
    )
    handler.setLevel(logging.WARNING)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    for name in (None, "uvicorn"):  # uvicorn passes nothing on
        logging.getLogger(name).addHandler(handler)


def note_settings(runs: Path, settings: dict[str, Any]) -> None:
    """Store the settings of a server, by name and without secrets, for `palpate doctor`."""
    (runs / _SETTINGS).write_text(json.dumps(settings, indent=1))


def noted_settings(runs: Path) -> dict[str, Any] | None:
    """The settings that a server in these runs was started with last; None where none was."""
    try:
        noted = json.loads((runs / _SETTINGS).read_text())
    except (OSError, ValueError):
        return None
    return noted if isinstance(noted, dict) else None


def diagnostics(runs: Path, settings: dict[str, Any]) -> str:
    """Return the text for a report of a fault.

    Args:
        runs: folder of the runs.
        settings: of the server, by name; without secrets.
    """
    parts = {
        "versions": _versions(),
        "machine": _machine(runs),
        "settings": (f"{name} = {value}" for name, value in settings.items()),
        "last jobs": _jobs(runs / "jobs.sqlite"),
        "log": _log(runs / LOG),
    }
    made = time.strftime("%Y-%m-%d %H:%M:%S %z")
    sections = ("\n".join([f"[{title}]", *lines]) for title, lines in parts.items())
    return "\n\n".join([f"Palpate diagnostics, {made}", *sections]) + "\n"


def _versions() -> Iterator[str]:
    yield f"python {sys.version.split()[0]}"
    software = software_of()
    yield f"commit {software['commit']}, sources {software['code']}"
    for name in _PACKAGES:
        try:
            yield f"{name} {metadata.version(name)}"
        except metadata.PackageNotFoundError:
            yield f"{name} is not installed"


def _machine(runs: Path) -> Iterator[str]:
    yield platform.platform()
    yield f"{os.cpu_count()} processors"
    memory = Path("/proc/meminfo")
    if memory.is_file():
        yield from memory.read_text().split("\n")[:3]
    place = next(one for one in (runs, *runs.absolute().parents) if one.exists())
    yield f"{shutil.disk_usage(place).free / 2**30:.1f} GiB free at the runs"


def _jobs(path: Path) -> Iterator[str]:
    """The last jobs and the last lines of each; the file is opened for reading alone."""
    if not path.is_file():
        yield "none"
        return
    try:
        database = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
    except sqlite3.Error as error:
        yield f"cannot be read: {error}"
        return
    try:
        for identity, *rest, stored in database.execute(
            "select id, kind, state, attempt, fraction, error from jobs "
            "order by rowid desc limit ?",
            [_JOBS],
        ).fetchall():
            yield f"{identity}: " + ", ".join(str(value) for value in rest if value is not None)
            if stored is not None:
                yield f"    {_told(stored)}"
            notes = database.execute(
                "select level, text from log where job = ? order by rowid desc limit ?",
                [identity, _NOTES],
            ).fetchall()
            yield from (f"    {level}: {text}" for level, text in reversed(notes))
    except sqlite3.Error as error:
        yield f"cannot be read: {error}"
    finally:
        database.close()


def _told(stored: str) -> str:
    """Kind and message of a stored error, without the values of its place."""
    try:
        error = json.loads(stored)
        return f"{error['kind']}: {error['message']}"
    except (ValueError, KeyError, TypeError):
        return "an error that cannot be read"


def _log(path: Path) -> list[str]:
    if not path.is_file():
        return ["empty"]
    return path.read_text(encoding="utf-8", errors="replace").split("\n")[-_LINES:]
