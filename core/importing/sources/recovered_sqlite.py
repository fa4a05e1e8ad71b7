"""ROS 2 sqlite3 files that are cut off: rows are read until the first that is damaged."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.rosbag2.errors import ReaderError

__all__ = ["RecoveredSqlite"]


class RecoveredSqlite:
    """A damaged sqlite3 file: the messages before the damage, in the order they were written.

    Attributes:
        connections: of its topics, as of a reader of rosbags.
        start_time: stamp of the first message [ns].
        end_time: stamp after the last whole one [ns].
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.start_time, self.end_time = 2**63 - 1, 0
        self._database: sqlite3.Connection | None = None

    def open(self) -> None:
        """Read the topics and count what is whole; ReaderError where nothing is."""
        self._database = sqlite3.connect(f"file:{self.path}?mode=ro&immutable=1", uri=True)
        # Else SQLite refuses a file that is shorter than its header states.
        self._database.execute("PRAGMA writable_schema = ON")
        try:
            topics = self._database.execute(
                "SELECT id, name, type, serialization_format FROM topics"
            ).fetchall()
        except sqlite3.Error as error:
            self.close()
            raise ReaderError(f"its list of topics is damaged ({error})") from None
        counts = Counter[int]()
        for topic, stamp, _ in self._rows("length(data)"):
            counts[topic] += 1
            self.start_time = min(self.start_time, stamp)
            self.end_time = max(self.end_time, stamp + 1)
        none = MessageDefinition(MessageDefinitionFormat.NONE, "")
        self.connections = [
            Connection(
                number, name, kind, none, "", counts[number], ConnectionExtRosbag2(coding, []), self
            )
            for number, name, kind, coding in topics
        ]

    def close(self) -> None:
        """Close the file."""
        if self._database is not None:
            self._database.close()
            self._database = None

    def messages(
        self, connections: Collection[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Read the messages of these connections: connection, stamp [ns], bytes."""
        by_number = {one.id: one for one in connections}
        for topic, stamp, data in self._rows("data"):
            if topic in by_number and isinstance(data, bytes):
                yield by_number[topic], stamp, data

    def _rows(self, column: str) -> Iterator[tuple[int, int, object]]:
        """Rows in the order of writing, up to the first that cannot be read."""
        assert self._database is not None
        query = f"SELECT topic_id, timestamp, {column} FROM messages NOT INDEXED ORDER BY id"
        try:
            for topic, stamp, value in self._database.execute(query):
                if topic is None or stamp is None or value is None:
                    return  # pages beyond the end read as zeros
                yield topic, stamp, value
        except sqlite3.Error:
            return
