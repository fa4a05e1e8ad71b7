"""Results on disk: how stores of all kinds name, list and read them."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from pathlib import Path
from typing import Any

from palpate.app.http_errors import Missing
from palpate.foundation.errors import RunError

__all__ = ["DAMAGED", "NAME", "ResultStore", "read_object", "request_name"]

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,199}")
"""Names of results and datasets: safe as the name of a file, also with an ending."""

DAMAGED = (RunError, AttributeError, KeyError, TypeError, ValueError)
"""Errors from a result that is damaged, or another program's."""


class ResultStore:
    """Results of one kind below one folder, each in a subfolder of its name.

    Args:
        folder: holds the results.
        kind: singular noun, as in messages and in the REST path /api/KINDs.
        first: name of the file that a result has as soon as it has begun.
        last: name of the file that it has once it is finished; may be the same.
    """

    def __init__(self, folder: Path, kind: str, first: str, last: str) -> None:
        self.folder, self.kind, self.first, self.last = folder, kind, first, last

    def names(self) -> list[str]:
        """Names of all results that have begun, the newest first."""
        return list(self.created())

    def created(self) -> dict[str, float]:
        """Times of the last change of the first file [s since 1970] of all results, by name, the
        newest first.
        """
        found = {}
        for path in self.folder.glob(f"*/{self.first}"):
            with contextlib.suppress(OSError):  # deleted by another request
                if NAME.fullmatch(path.parent.name) and path.is_file():
                    found[path.parent.name] = path.stat().st_mtime
        return dict(sorted(found.items(), key=lambda one: -one[1]))

    def folders(self, name: str) -> list[Path]:
        """Folders of which a result consists."""
        return [self.folder / name]

    def finished(self) -> list[str]:
        """Names of the finished results whose files can be read, the newest first."""
        return [name for name in self.names() if self._is_readable(name)]

    def has_begun(self, name: str) -> bool:
        """Whether the first file of a result is on disk."""
        return bool(NAME.fullmatch(name)) and (self.folder / name / self.first).is_file()

    def request(self, name: str) -> dict[str, Any]:
        """Content of the first file; raises Missing where the result has not begun."""
        if not self.has_begun(name):
            raise self.missing(name)
        return self._object(name, self.first)

    def result(self, name: str) -> dict[str, Any] | None:
        """Content of the last file; None before the result is finished."""
        if not NAME.fullmatch(name) or not (self.folder / name / self.last).is_file():
            return None
        return self._object(name, self.last)

    def missing(self, name: str) -> Missing:
        """The error for a name that no result has."""
        where = f"GET /api/{self.kind}s lists the existing ones"
        return Missing(f"there is no {self.kind} {name}; {where}", **{self.kind: name})

    def _is_readable(self, name: str) -> bool:
        try:
            return bool(self.request(name)) and self.result(name) is not None
        except (Missing, RunError):
            return False

    def _object(self, name: str, file: str) -> dict[str, Any]:
        return read_object(self.folder / name / file, self.kind, name)


def read_object(path: Path, kind: str, name: str) -> dict[str, Any]:
    """The JSON object in a file of a result; raises RunError where there is none."""
    try:
        text = path.read_text()
        value = json.loads(text)
        if "\\ud" in text.lower():  # half of a surrogate pair could not be sent
            json.dumps(value, ensure_ascii=False).encode()
    except (OSError, ValueError, RecursionError) as error:
        raise unusable(path.name, f"cannot be read ({error})", kind, name) from error
    if not isinstance(value, dict):
        raise unusable(path.name, f"holds {type(value).__name__}, expected an object", kind, name)
    return value


def unusable(file: str, problem: str, kind: str, name: str) -> RunError:
    """The error for a damaged file of a result."""
    message = f"{kind} {name}: {file} {problem}; make the {kind} again"
    return RunError(message, **{kind: name, "file": file})


def request_name(prefix: str, request: list[Any]) -> str:
    """`PREFIX-DIGEST`: the same request always has the same name, so that it can be resumed."""
    text = json.dumps(request, sort_keys=True)
    return f"{prefix}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
