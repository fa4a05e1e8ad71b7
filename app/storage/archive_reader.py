"""Reader of archives: lists their plain files, and the entries that may not be in a dataset.

Headers are read with a bound, since a few megabytes can unpack to gigabytes of a name.
"""

from __future__ import annotations

import bz2
import lzma
import re
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any

from palpate.foundation.errors import DatasetError

__all__ = ["MOST_FILES", "Entry", "Found", "entries_of", "is_archive", "is_ignored"]

MOST_FILES = 300_000
DEEPEST, LONGEST = 8, 200
_IGNORED = ("__MACOSX", ".DS_Store", "Thumbs.db")
_ODD = re.compile(r'[\x00-\x1f\x7f\\:*?"<>|\ud800-\udfff]')
_FIRST, _LARGEST_HEADER = 2**20, 2**16
"""Bytes of a file in which a tar is recognised, and of a header of a tar besides its block."""
_HEADERS = (
    tarfile.GNUTYPE_LONGNAME,
    tarfile.GNUTYPE_LONGLINK,
    tarfile.XHDTYPE,
    tarfile.XGLTYPE,
    tarfile.SOLARIS_XHDTYPE,
)


@dataclass(frozen=True)
class Entry:
    """A plain file: its path in the archive, its stated size [bytes], and a function
    that opens it.
    """

    path: PurePosixPath
    size: int
    open: Callable[[], AbstractContextManager[IO[bytes]]]


Found = tuple[list[Entry], list[str]]
"""Plain files, and a sentence for each entry that may not be in a dataset."""


def is_archive(path: Path) -> bool:
    """Whether a file is a zip, or begins as a tar does, compressed or not."""
    if zipfile.is_zipfile(path):
        return True
    with path.open("rb") as file:
        first = file.read(_FIRST)
    return any(_begins_as_tar(first, opened) for opened in (_plain, _gzip, _bzip2, _xz))


@contextmanager
def entries_of(archive: Path, most: int) -> Iterator[Found]:
    """Look through an archive; files beyond `most` bytes in all are not looked for."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as opened:
            yield _of_zip(opened)
    elif is_archive(archive):
        with tarfile.open(archive, tarinfo=_BoundedHeader) as tape:
            yield _of_tar(tape, most)
    else:
        raise DatasetError(
            "this is neither a zip nor a tar; pack the dataset's folder as one of them",
            file=archive.name,
        )


def is_ignored(name: str) -> bool:
    """Whether a path belongs to what operating systems add to folders."""
    return any(part in _IGNORED for part in name.split("/"))


class _BoundedHeader(tarfile.TarInfo):
    """An entry of a tar whose long names and attributes have a limit."""

    def _proc_member(self, tape: tarfile.TarFile) -> Any:
        if self.type in _HEADERS and self.size > _LARGEST_HEADER:
            raise DatasetError(
                f"a name or attribute in the archive has {self.size} bytes; at most "
                f"{_LARGEST_HEADER} are read: pack it again as .zip or .tar.gz",
                value=self.size,
                high=_LARGEST_HEADER,
            )
        return super()._proc_member(tape)  # type: ignore[misc]


def _plain(data: bytes) -> bytes:
    return data


def _gzip(data: bytes) -> bytes:
    return zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(data, tarfile.BLOCKSIZE)


def _bzip2(data: bytes) -> bytes:
    return bz2.BZ2Decompressor().decompress(data, tarfile.BLOCKSIZE)


def _xz(data: bytes) -> bytes:
    return lzma.LZMADecompressor(memlimit=2**27).decompress(data, tarfile.BLOCKSIZE)


def _begins_as_tar(data: bytes, opened: Callable[[bytes], bytes]) -> bool:
    try:
        block = opened(data)[: tarfile.BLOCKSIZE]
        tarfile.TarInfo.frombuf(block, "utf-8", "surrogateescape")
    except (tarfile.HeaderError, zlib.error, lzma.LZMAError, OSError, EOFError):
        return False
    return True


def _of_zip(opened: zipfile.ZipFile) -> Found:
    entries: list[Entry] = []
    bad: list[str] = []
    for info in opened.infolist():
        if info.is_dir() or is_ignored(info.filename):
            continue
        kind = info.external_attr >> 16
        if info.flag_bits & 1:
            bad.append(f"{info.filename}: is encrypted")
        elif kind and not stat.S_ISREG(kind) and stat.S_IFMT(kind):
            bad.append(f"{info.filename}: is a link or no plain file")
        else:
            _take(entries, bad, info.filename, info.file_size, lambda info=info: opened.open(info))  # type: ignore[misc]
    return entries, bad


def _of_tar(tape: tarfile.TarFile, most: int) -> Found:
    entries: list[Entry] = []
    bad: list[str] = []
    total = 0
    for info in tape:
        total += info.size
        if info.isdir() or is_ignored(info.name):
            continue
        if not info.isreg() or info.issparse():
            bad.append(f"{info.name[:LONGEST]}: is a link or no plain file")
        else:
            _take(entries, bad, info.name, info.size, lambda info=info: _opened(tape, info))  # type: ignore[misc]
        if len(entries) > MOST_FILES or total > most:
            break
    return entries, bad


def _opened(tape: tarfile.TarFile, info: tarfile.TarInfo) -> IO[bytes]:
    stream = tape.extractfile(info)
    if stream is None:
        raise tarfile.ReadError(f"{info.name} has no content")
    return stream


def _take(
    entries: list[Entry],
    bad: list[str],
    name: str,
    size: int,
    opening: Callable[[], AbstractContextManager[IO[bytes]]],
) -> None:
    path = PurePosixPath(name)
    parts = [part for part in path.parts if part != "."]
    if path.is_absolute() or ".." in parts or _ODD.search(name) or not parts:
        bad.append(f"{name[:80]!r}: leads out of the folder, or is no name for a file")
    elif len(parts) > DEEPEST or len(name.encode()) > LONGEST:
        bad.append(
            f"{name[:80]!r}: is longer than {LONGEST} bytes or deeper than {DEEPEST} folders"
        )
    else:
        entries.append(Entry(PurePosixPath(*parts), size, opening))
