"""Archives from outside: unpacked completely or not at all; plain files inside the folder only."""

from __future__ import annotations

import re
import shutil
import stat
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO

from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent

__all__ = ["MOST_FILES", "copy_folder", "dataset_root", "is_archive", "unpack"]

MOST_FILES = 300_000
DEEPEST, LONGEST = 8, 200
_CHUNK = 2**20
_IGNORED = ("__MACOSX", ".DS_Store", "Thumbs.db")
_ODD = re.compile(r'[\x00-\x1f\x7f\\:*?"<>|\ud800-\udfff]')
_MOST_TOLD = 20


@dataclass(frozen=True)
class _Entry:
    """A plain file: its path in the archive, its stated size [bytes], and a function
    that opens it.
    """

    path: PurePosixPath
    size: int
    open: Callable[[], AbstractContextManager[IO[bytes]]]


def is_archive(path: Path) -> bool:
    """Whether a file is a zip or a tar, compressed or not."""
    return zipfile.is_zipfile(path) or tarfile.is_tarfile(path)


def unpack(archive: Path, target: Path, most: int, report: Report = silent) -> None:
    """Unpack into `target`, at most `most` bytes; raises DatasetError that lists all refused
    entries.
    """
    try:
        with _entries(archive) as entries:
            _write(entries, target, most, report)
    except (
        zipfile.BadZipFile,
        tarfile.TarError,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
    ) as error:
        raise DatasetError(
            f"the archive cannot be read ({error}); pack it again as .zip or .tar.gz",
            file=archive.name,
        ) from error


def copy_folder(source: Path, target: Path, most: int, report: Report = silent) -> None:
    """Copy a folder of plain files by the same rules; links are refused."""
    entries: list[_Entry] = []
    bad: list[str] = []
    for path in sorted(source.rglob("*")):
        if path.name in _IGNORED or any(
            part in _IGNORED for part in path.relative_to(source).parts
        ):
            continue
        inside = PurePosixPath(path.relative_to(source).as_posix())
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            bad.append(f"{inside}: is a link or no plain file")
        elif path.is_file():
            entries.append(_Entry(inside, path.stat().st_size, lambda path=path: path.open("rb")))  # type: ignore[misc]
    _write((entries, bad), target, most, report)


def dataset_root(folder: Path) -> Path:
    """The folder of dataset.toml among the unpacked files: at the top, or in the only folder with
    one.
    """
    folders = [
        path.parent for depth in ("", "*/", "*/*/") for path in folder.glob(f"{depth}dataset.toml")
    ]
    if len(folders) == 1:
        return folders[0]
    what = "no dataset.toml" if not folders else f"{len(folders)} datasets"
    raise DatasetError(
        f"there is {what} in what was brought; expected the folder of one dataset",
        file="dataset.toml",
    )


@contextmanager
def _entries(archive: Path) -> Iterator[tuple[list[_Entry], list[str]]]:
    """The plain files of an archive, and the problems of its other entries."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as opened:
            yield _of_zip(opened)
    elif tarfile.is_tarfile(archive):
        with tarfile.open(archive) as tape:
            yield _of_tar(tape)
    else:
        raise DatasetError(
            "this is neither a zip nor a tar; pack the dataset's folder as one of them",
            file=archive.name,
        )


def _of_zip(opened: zipfile.ZipFile) -> tuple[list[_Entry], list[str]]:
    entries: list[_Entry] = []
    bad: list[str] = []
    for info in opened.infolist():
        if info.is_dir() or _ignored(info.filename):
            continue
        kind = info.external_attr >> 16
        if info.flag_bits & 1:
            bad.append(f"{info.filename}: is encrypted")
        elif kind and not stat.S_ISREG(kind) and stat.S_IFMT(kind):
            bad.append(f"{info.filename}: is a link or no plain file")
        else:
            _take(entries, bad, info.filename, info.file_size, lambda info=info: opened.open(info))  # type: ignore[misc]
    return entries, bad


def _of_tar(tape: tarfile.TarFile) -> tuple[list[_Entry], list[str]]:
    entries: list[_Entry] = []
    bad: list[str] = []
    for info in tape:
        if info.isdir() or _ignored(info.name):
            continue
        if not info.isreg():
            bad.append(f"{info.name}: is a link or no plain file")
        else:
            _take(entries, bad, info.name, info.size, lambda info=info: _opened(tape, info))  # type: ignore[misc]
        if len(entries) > MOST_FILES:
            break
    return entries, bad


def _opened(tape: tarfile.TarFile, info: tarfile.TarInfo) -> IO[bytes]:
    stream = tape.extractfile(info)
    if stream is None:
        raise tarfile.ReadError(f"{info.name} has no content")
    return stream


def _ignored(name: str) -> bool:
    return any(part in _IGNORED for part in name.split("/"))


def _take(
    entries: list[_Entry],
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
        entries.append(_Entry(PurePosixPath(*parts), size, opening))


def _write(
    checked: tuple[list[_Entry], list[str]], target: Path, most: int, report: Report
) -> None:
    entries, bad = checked
    seen: set[PurePosixPath] = set()
    for entry in entries:
        if entry.path in seen:
            bad.append(f"{entry.path}: is there twice")
        seen.add(entry.path)
    for folder in {above for path in seen for above in path.parents} & seen:
        bad.append(f"{folder}: is a file and a folder")
    if bad:
        more = f"\nand {len(bad) - _MOST_TOLD} more" if len(bad) > _MOST_TOLD else ""
        text = "\n".join(bad[:_MOST_TOLD])
        raise DatasetError(
            f"{len(bad)} entries may not be in a dataset, and nothing was taken:\n{text}{more}",
            problems=len(bad),
        )
    if len(entries) > MOST_FILES:
        raise DatasetError(
            f"there are more than {MOST_FILES} files; expected one dataset", problems=len(entries)
        )
    total = sum(entry.size for entry in entries)
    if total > most:
        raise _too_large(total, most)
    free = shutil.disk_usage(target.parent).free
    if total > 0.9 * free:
        raise DatasetError(
            f"{_shown(total)} are to be written and {_shown(free)} are free: make room", value=total
        )
    _fill(entries, target, most, total, report)


def _fill(entries: list[_Entry], target: Path, most: int, total: int, report: Report) -> None:
    """Write the files; the stated sizes are not trusted."""
    written = 0
    for number, entry in enumerate(entries):
        place = target / entry.path
        place.parent.mkdir(parents=True, exist_ok=True)
        with entry.open() as source, place.open("wb") as sink:
            while chunk := source.read(_CHUNK):
                written += len(chunk)
                if written > most:
                    raise _too_large(written, most)
                sink.write(chunk)
        if number % 50 == 0:
            report(
                min(1.0, written / max(total, 1)), f"unpacking file {number + 1} of {len(entries)}"
            )


def _too_large(total: int, most: int) -> DatasetError:
    return DatasetError(
        f"unpacked it is {_shown(total)} or more; at most {_shown(most)} are taken",
        value=total,
        high=most,
    )


def _shown(count: int) -> str:
    return f"{count / 2**30:.1f} GiB" if count >= 2**30 else f"{count / 2**20:.1f} MiB"
