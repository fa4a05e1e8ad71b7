"""Errors of the service, and all errors as JSON with a status code."""

from __future__ import annotations

from typing import Any

from palpate.foundation.errors import PalpateError, RunError

__all__ = ["Conflict", "Missing", "as_dict", "status_code"]


class Missing(PalpateError):
    """Nothing has the requested name."""


class Conflict(PalpateError):
    """The request does not fit the state of the thing that it names."""


def as_dict(error: PalpateError) -> dict[str, Any]:
    """An error as `{kind, message, where}` with plain values."""
    where = {
        key: value if isinstance(value, (int, float, str, bool)) else str(value)
        for key, value in error.where.items()
    }
    return {"kind": type(error).__name__, "message": error.message, "where": where}


def status_code(error: PalpateError) -> int:
    """404 for a missing name, 409 for a conflict or a damaged result, 422 for invalid data or
    values.
    """
    if isinstance(error, Missing):
        return 404
    return 409 if isinstance(error, (Conflict, RunError)) else 422
