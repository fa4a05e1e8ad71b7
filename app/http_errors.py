"""Errors of the service, and all errors as JSON with a status code."""

from __future__ import annotations

import errno
import math
import sqlite3
from typing import Any

from palpate.foundation.errors import PalpateError, RunError

__all__ = ["Conflict", "Missing", "NoSpace", "as_dict", "disk_is_full", "status_code"]


class Missing(PalpateError):
    """Nothing has the requested name."""


class Conflict(PalpateError):
    """The request does not fit the state of the thing that it names."""


_FULL = (
    "the disk of the runs folder is full: empty the caches (Jobs on the page, or POST "
    "/api/disk/empty), delete runs, or make room; waiting jobs then go on, "
    "and failed ones can be retried"
)


class NoSpace(PalpateError):
    """The disk is full, or the results take more than they may."""

    def __init__(self, message: str = _FULL) -> None:
        super().__init__(message)


def disk_is_full(error: BaseException) -> bool:
    """Whether an error of the file system or of SQLite says that there is no room."""
    if isinstance(error, sqlite3.Error):
        return error.sqlite_errorcode == sqlite3.SQLITE_FULL
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def as_dict(error: PalpateError) -> dict[str, Any]:
    """An error as `{kind, message, where}` with plain values."""
    where = {_text(key): _plain(value) for key, value in error.where.items()}
    return {"kind": type(error).__name__, "message": _text(error.message), "where": where}


def _plain(value: object) -> int | float | str | bool:
    """A value that JSON has, or its text."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if isinstance(value, (int, float, bool)) else _text(str(value))


def _text(text: str) -> str:
    """Text that can be sent: halves of surrogate pairs, which a request may have, as escapes."""
    return text.encode("utf-8", "backslashreplace").decode()


def status_code(error: PalpateError) -> int:
    """404 for a missing name, 409 for a conflict or a damaged result, 507 for a full disk, 422 for
    invalid data or values.
    """
    if isinstance(error, Missing):
        return 404
    if isinstance(error, NoSpace):
        return 507
    return 409 if isinstance(error, (Conflict, RunError)) else 422
