"""Readers of rosbags for a recording, whole or damaged."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1 import ReaderError as Ros1Error
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2 import ReaderError as Ros2Error
from rosbags.serde import SerdeError

from palpate.foundation.errors import DatasetError
from palpate.importing.sources.recovered_mcap import RecoveredMcap
from palpate.importing.sources.recovered_ros1 import RecoveredRos1
from palpate.importing.sources.recovered_sqlite import RecoveredSqlite

__all__ = ["BAG_SUFFIXES", "BROKEN", "open_readers", "storage_files", "unknown_coding"]

BAG_SUFFIXES = (".bag", ".db3", ".mcap")
BROKEN = (
    Ros1Error, Ros2Error, SerdeError, struct.error, RuntimeError, OSError, EOFError, ValueError,
    AssertionError,
)  # fmt: skip
"""Errors of readers at damaged places."""


def open_readers(path: Path) -> tuple[list[Any], list[str]]:
    """Open a file, or a folder of ROS 2 by its metadata or file by file.

    Returns:
        readers of rosbags, and warnings.

    Raises DatasetError where nothing of it can be read.
    """
    name = path.name
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        return _each(path, f"{name}: has no metadata.yaml; its files were read")
    try:
        return [_whole(path)], []
    except Ros2Error as error:
        if "Serialization format" in str(error):
            raise unknown_coding(path, str(error)) from None
        if path.is_dir() and storage_files(path):
            return _each(
                path, f"{name}: its metadata.yaml is damaged ({error}); its files were read"
            )
        reader, warning = _recovered(path, error)
        return [reader], [warning]
    except BROKEN as error:
        reader, warning = _recovered(path, error)
        return [reader], [warning]


def storage_files(folder: Path) -> list[Path]:
    """Storage files of ROS 2 in a folder, sorted."""
    found = (one for one in folder.iterdir() if one.suffix in (".db3", ".mcap"))
    return sorted(one for one in found if not one.name.startswith("."))


def unknown_coding(path: Path, found: str) -> DatasetError:
    """Make the error for messages that are serialised as nobody knows."""
    return DatasetError(
        f"{path.name}: {found} Expected cdr: convert it by ros2 bag convert where this format is "
        "installed",
        file=path.name,
    )


def _each(folder: Path, warning: str) -> tuple[list[Any], list[str]]:
    """Open the storage files of a folder one by one."""
    readers, warnings = [], [warning]
    for file in storage_files(folder):
        try:
            readers.append(_whole(file))
        except BROKEN as error:
            reader, said = _recovered(file, error)
            readers.append(reader)
            warnings.append(said)
    return readers, warnings


def _whole(path: Path) -> Any:
    reader = Ros1Reader(path) if path.suffix == ".bag" else Ros2Reader(path)
    reader.open()
    return reader


def _recovered(path: Path, error: BaseException) -> tuple[Any, str]:
    """Open what is whole of a damaged file, with a warning."""
    makers: dict[str, Callable[[Path], Any]] = {
        ".bag": RecoveredRos1,
        ".mcap": lambda one: _BareStorage(RecoveredMcap(one)),
        ".db3": RecoveredSqlite,
    }
    if path.suffix in makers and path.is_file():
        with suppress(*BROKEN):
            reader = makers[path.suffix](path)
            reader.open()
            if reader.connections:
                text = f"{path.name}: is cut off or damaged ({error}); the whole part was read"
                return reader, text
            reader.close()
    raise DatasetError(
        f"{path.name} cannot be read: {error}; expected a whole recording of ROS: copy it again, "
        "or record it anew",
        file=path.name,
    )


class _BareStorage:
    """A storage file of rosbags with the stamps that its folder would state."""

    def __init__(self, storage: Any) -> None:
        self._storage = storage

    def __getattr__(self, name: str) -> Any:
        return getattr(self._storage, name)

    @property
    def start_time(self) -> int:
        """Stamp of the first message [ns]."""
        return int(self._storage.metadata.start_time)

    @property
    def end_time(self) -> int:
        """Stamp after the last message [ns]."""
        return int(self._storage.metadata.end_time)
