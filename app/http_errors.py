"""Problems that only the service knows, and how every problem goes over the wire."""

from __future__ import annotations

from typing import Any

from palpate.foundation.errors import PalpateError, RunError

__all__ = ["Conflict", "Missing", "as_dict", "status_code"]


class Missing(PalpateError):
    """A name that nothing here has."""


class Conflict(PalpateError):
    """A request that does not fit the state of the thing it names."""


def as_dict(error: PalpateError) -> dict[str, Any]:
    """The problem as `{kind, message, where}` with plain values."""
    where = {
        key: value if isinstance(value, (int, float, str, bool)) else str(value)
        for key, value in error.where.items()
    }
    return {"kind": type(error).__name__, "message": error.message, "where": where}


def status_code(error: PalpateError) -> int:
    """404 for what is not there, 409 for what does not fit now, 422 for data and values that are
    off.
    """
    if isinstance(error, Missing):
        return 404
    return 409 if isinstance(error, (Conflict, RunError)) else 422
