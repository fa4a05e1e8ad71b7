"""The results that version 0.1 left on disk, unpacked where a test wants them, and its answers."""

from __future__ import annotations

import json
import os
import sqlite3
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

__all__ = ["OldHome", "differences", "unpack_old_results"]

ARCHIVE = Path(__file__).parent / "app" / "legacy" / "results-0.1.tar.xz"
OLD_PLACE = "/srv/palpate"
"""Folder in which version 0.1 made the results; its files name it."""
VOLATILE = {"remaining", "used", "caches"}
"""Keys whose values depend on the moment of the question."""
TIMES = {"started", "finished", "at"}
LIES = ("are byte for byte one before them", "changes in fz alone")
"""Parts of warnings about lies in the data of version 0.1, which did not see them: its clouds are
copies of each other, and its forces have one axis."""
NAMED_BY = {".beginnings": "effect", ".targets": "key"}
"""End of the places of lists with an item for each effect or target, and the key of its name."""
TOLERANCE = 1e-4
"""Relative difference of solved values [1]; solvers end within it on every processor."""


@dataclass(frozen=True)
class OldHome:
    """Folders of a server of version 0.1 as it was killed.

    Attributes:
        path: holds `runs` and `datasets`.
        expected: holds what version 0.1 answered and computed.
    """

    path: Path
    expected: Path

    @property
    def runs(self) -> Path:
        return self.path / "runs"

    @property
    def datasets(self) -> Path:
        return self.path / "datasets"

    @cached_property
    def answers(self) -> dict[str, Any]:
        """Status and body that version 0.1 answered, by path or `POST path body`."""
        text = (self.expected / "answers.json").read_text()
        return dict(json.loads(text.replace(OLD_PLACE, str(self.path))))

    @cached_property
    def killed(self) -> float:
        """When the server of version 0.1 was killed [s since 1970]."""
        return float(json.loads((self.expected / "left.json").read_text())["killed"])

    def run(self) -> str:
        """Name of the run that a diagnosis made."""
        return next(
            job["id"]
            for job in self.answers["jobs"]["answer"]
            if job["kind"] == "diagnosis" and job["state"] == "done"
        )

    def jobs(self, kind: str, state: str) -> list[str]:
        """Identities of the jobs of a kind that version 0.1 left in a state."""
        return [
            job["id"]
            for job in self.answers["jobs"]["answer"]
            if (job["kind"], job["state"]) == (kind, state)
        ]


def unpack_old_results(folder: Path) -> OldHome:
    """Unpack the results; files that name their place name the new one afterwards."""
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(folder, filter="data")
    home = OldHome(folder / "home", folder / "expected")
    for path in home.path.rglob("*.json"):
        text, times = path.read_text(), path.stat()
        if OLD_PLACE in text:
            path.write_text(text.replace(OLD_PLACE, str(home.path)))
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    database = sqlite3.connect(home.runs / "jobs.sqlite")
    with database:
        database.execute(
            "update jobs set request = replace(request, ?, ?)", [OLD_PLACE, str(home.path)]
        )
    database.close()
    return home


def differences(
    old: Any, new: Any, place: str = "", *, tolerance: float = 0.0, until: float = float("inf")
) -> Iterator[str]:
    """Yield where an answer lacks or changes something of the old one.

    More keys are no difference, nor effects and targets that version 0.1 did not know, nor warnings
    about `LIES`. Strings with blanks are prose, which may be worded anew.

    Args:
        old: what version 0.1 answered.
        new: what is answered now.
        place: what is compared, for the text of a difference.
        tolerance: relative difference of numbers that counts as none [1].
        until: when version 0.1 ended [s since 1970]; later times are not compared.
    """
    more: dict[str, Any] = {"tolerance": tolerance, "until": until}
    if isinstance(old, dict) and isinstance(new, dict):
        for key in old:
            later = key in TIMES and isinstance(old[key], float) and old[key] > until
            if key in VOLATILE or later:
                continue
            if key not in new:
                yield f"{place}.{key} is missing"
            else:
                yield from differences(old[key], new[key], f"{place}.{key}", **more)
    elif isinstance(old, list) and isinstance(new, list):
        new = _known(old, new, place)
        if len(old) != len(new):
            yield f"{place}: {len(old)} items before, {len(new)} now"
        for number, (one, other) in enumerate(zip(old, new, strict=False)):
            yield from differences(one, other, f"{place}[{number}]", **more)
    elif isinstance(old, float) and isinstance(new, (int, float)) and not isinstance(new, bool):
        if abs(old - new) > tolerance * max(abs(old), abs(new), 1e-6):
            yield f"{place}: {old!r} before, {new!r} now"
    elif not (isinstance(old, str) and isinstance(new, str) and " " in old and new) and old != new:
        yield f"{place}: {old!r} before, {new!r} now"


def _known(old: list[Any], new: list[Any], place: str) -> list[Any]:
    """The items of a new list without those that version 0.1 did not know."""
    if place.endswith(".warnings"):
        return [text for text in new if not any(sign in text for sign in LIES)]
    name = next((name for end, name in NAMED_BY.items() if place.endswith(end)), None)
    if name is None:
        return new
    known = {item[name] for item in old}
    return [item for item in new if item[name] in known]
