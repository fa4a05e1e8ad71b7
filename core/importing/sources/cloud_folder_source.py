"""Folders of clouds whose names are their stamps."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path

from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.cloud_file import CLOUD_SUFFIXES, read_cloud_file
from palpate.importing.stream import Sample, Stream

__all__ = ["CloudFolderSource"]

_STAMP = re.compile(r"(\d+)(?:[._](\d+))?$", re.ASCII)
_UNITS = ((10**17, 1), (10**14, 10**3), (10**11, 10**6), (10**8, 10**9))
"""Least stamp since 1970 in ns, us, ms and s, and its unit [ns]."""


class CloudFolderSource:
    """A folder of cloud files, one for each frame, named by stamps since 1970 in s, ms, us or ns.

    Attributes:
        path: of the folder.
        warnings: found on reading.
        has_receipt: whether times of receipt are a clock of their own.
        rules: None, as it is no table.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []
        self.has_receipt = False
        self.rules: ColumnRules | None = None
        found = [(self._stamp(one), one) for one in _clouds(path)]
        self._clouds = sorted(found)

    @staticmethod
    def fits(path: Path) -> bool:
        """Whether a path is such a folder."""
        return path.is_dir() and bool(_clouds(path))

    def files(self) -> tuple[Path, ...]:
        """List the clouds in order of their stamps."""
        return tuple(one for _, one in self._clouds)

    def close(self) -> None:
        """Do nothing: files are opened one by one."""

    def streams(self) -> tuple[Stream, ...]:
        """List the one stream of clouds."""
        stamps = [stamp for stamp, _ in self._clouds]
        return (
            Stream(
                name=self.path.name,
                kind="cloud",
                message_type=f"{self._clouds[0][1].suffix[1:]} files",
                count=len(stamps),
                seconds=(stamps[-1] - stamps[0]) / 1e9,
            ),
        )

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the clouds in order of their stamps."""
        if self.path.name not in names:
            return
        for stamp, file in self._clouds:
            yield Sample(
                stream=self.path.name,
                received=stamp,
                stamped=stamp,
                frame="",
                value=partial(read_cloud_file, file),
            )

    @staticmethod
    def _stamp(file: Path) -> int:
        match = _STAMP.search(file.stem)
        whole = int(match.group(1)) if match else 0
        for least, unit in _UNITS:
            if whole >= least:
                rest = match.group(2) if match and match.group(2) else ""
                return whole * unit + (round(float(f"0.{rest}") * unit) if rest else 0)
        raise DatasetError(
            f"{file.parent.name}/{file.name} has no stamp in its name; expected seconds or "
            "nanoseconds since 1970, or a table beside it with columns t and file: write one",
            file=file.name,
        )


def _clouds(path: Path) -> list[Path]:
    if not path.is_dir():
        return []
    return [
        one
        for one in path.iterdir()
        if one.suffix.lower() in CLOUD_SUFFIXES and not one.name.startswith(".") and one.is_file()
    ]
