"""Archives from outside: unpacked completely or not at all; plain files inside the folder only."""

from __future__ import annotations

import errno
import lzma
import shutil
import tarfile
import zipfile
import zlib
from itertools import islice
from pathlib import Path, PurePosixPath

from palpate.app.http_errors import NoSpace
from palpate.app.storage.archive_reader import MOST_FILES, Entry, Found, entries_of, is_ignored
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent

__all__ = ["copy_folder", "dataset_root", "unpack"]

_CHUNK = 2**20
_MOST_TOLD = 20
_RATIO, _ALWAYS = 200, 2**26
"""Unpacked bytes for each byte of an archive, and the unpacked bytes that any archive may have.
Numbers as text shrink to a tenth, and tables of zeros to a hundredth."""


def unpack(archive: Path, target: Path, most: int, report: Report = silent) -> None:
    """Unpack into `target`, at most `most` bytes and 200 times the archive's own size; raises
    DatasetError that lists all refused entries.
    """
    most = min(most, max(_ALWAYS, _RATIO * archive.stat().st_size))
    try:
        with entries_of(archive, most) as entries:
            _write(entries, target, most, report)
    except (
        zipfile.BadZipFile,
        tarfile.TarError,
        zlib.error,
        lzma.LZMAError,
        EOFError,
        IndexError,  # an empty name in a zip
        NotImplementedError,
        RuntimeError,
        ValueError,
    ) as error:
        raise _damaged(archive, error) from error
    except OSError as error:
        if error.errno not in (None, errno.EINVAL):  # the disk's, not the archive's
            raise
        raise _damaged(archive, error) from error


def _damaged(archive: Path, error: Exception) -> DatasetError:
    return DatasetError(
        f"the archive cannot be read ({error}); pack it again as .zip or .tar.gz", file=archive.name
    )


def copy_folder(source: Path, target: Path, most: int, report: Report = silent) -> None:
    """Copy a folder of plain files by the same rules; links are refused."""
    entries: list[Entry] = []
    bad: list[str] = []
    try:
        found = sorted(islice(source.rglob("*"), 2 * MOST_FILES))
        if len(found) == 2 * MOST_FILES:
            raise DatasetError(f"{source} holds too much; expected one dataset", key="folder")
        for path in found:
            _sort(path, source, entries, bad)
    except OSError as error:
        raise DatasetError(
            f"{source} cannot be read ({error}); name the folder of a dataset", key="folder"
        ) from error
    _write((entries, bad), target, most, report)


def _sort(path: Path, source: Path, entries: list[Entry], bad: list[str]) -> None:
    """Add a path to the entries of a folder, or the reason why it may not be in a dataset."""
    inside = PurePosixPath(path.relative_to(source).as_posix())
    if is_ignored(str(inside)):
        return
    if path.is_symlink() or not (path.is_file() or path.is_dir()):
        bad.append(f"{inside}: is a link or no plain file")
    elif path.is_file():
        entries.append(Entry(inside, path.stat().st_size, lambda: path.open("rb")))


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


def _write(checked: Found, target: Path, most: int, report: Report) -> None:
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
        raise NoSpace(
            f"{_shown(total)} are to be written and {_shown(free)} are free: make room, then retry"
        )
    _fill(entries, target, most, total, report)


def _fill(entries: list[Entry], target: Path, most: int, total: int, report: Report) -> None:
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
