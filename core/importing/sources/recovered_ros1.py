"""ROS 1 bags without an index, or with a damaged one: whole chunks are found by reading on."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO

from rosbags.rosbag1.reader import (
    Chunk,
    ChunkInfo,
    Header,
    IndexData,
    Reader,
    ReaderError,
    RecordType,
    decompressors,
    read_bytes,
    read_uint32,
)

__all__ = ["RecoveredRos1"]


class RecoveredRos1(Reader):
    """A ROS 1 bag whose recording was cut off: all whole messages of it."""

    _size: int = 0

    def open(self) -> None:
        """Find the whole chunks; ReaderError where there is none."""
        self.bio = bio = self.path.open("rb")
        try:
            if not bio.readline().startswith(b"#ROSBAG V2"):
                raise ReaderError("File magic is invalid.")
            self._skip_record(bio)
            self._size = self.path.stat().st_size
            while bio.tell() < self._size:
                try:
                    self._read_record(bio)
                except (ReaderError, RuntimeError, OSError, ValueError, EOFError):
                    break
        except BaseException:
            self.bio = None
            bio.close()
            raise
        self.connections = [
            one._replace(msgcount=len(self.indexes.get(one.id, ()))) for one in self.connections
        ]
        for entries in self.indexes.values():
            heapq.heapify(entries)
            entries.sort()

    def _read_record(self, bio: BinaryIO) -> None:
        """Read one record of the file; only chunks matter."""
        at = bio.tell()
        header = Header.read(bio)
        if header.get_uint8("op") != RecordType.CHUNK:
            read_bytes(bio, read_uint32(bio))
            return
        bio.seek(at)
        chunk = self.read_chunk()
        end = bio.tell()
        if end > self._size and chunk.decompressor is decompressors["none"]:
            chunk, end = chunk._replace(datasize=self._size - chunk.datapos), self._size
        bio.seek(chunk.datapos)
        inner = BytesIO(chunk.decompressor(read_bytes(bio, chunk.datasize)))
        self._index(at, chunk, list(_inner_records(self, inner)))
        bio.seek(end)

    def _index(self, at: int, chunk: Chunk, entries: list[tuple[int, int, int]]) -> None:
        """Take up the messages (connection, stamp, offset) of a chunk."""
        counts: dict[int, int] = defaultdict(int)
        for connection, stamp, offset in entries:
            self.indexes.setdefault(connection, []).append(IndexData(stamp, at, offset))
            counts[connection] += 1
        self.chunks[at] = chunk
        if entries:
            stamps = [stamp for _, stamp, _ in entries]
            self.chunk_infos.append(ChunkInfo(at, min(stamps), max(stamps) + 1, dict(counts)))

    def take_connection(self, inner: BytesIO, at: int) -> None:
        """Read the connection that stands at `at` of a chunk, unless it is known."""
        outer, self.bio = self.bio, inner
        inner.seek(at)
        try:
            found = self.read_connection()
        finally:
            self.bio = outer
        if all(one.id != found.id for one in self.connections):
            self.connections.append(found)

    @staticmethod
    def _skip_record(bio: BinaryIO) -> None:
        Header.read(bio)
        read_bytes(bio, read_uint32(bio))


def _inner_records(bag: RecoveredRos1, inner: BytesIO) -> Iterator[tuple[int, int, int]]:
    """Connection, stamp [ns] and offset of each whole message in a chunk."""
    size = len(inner.getbuffer())
    while (at := inner.tell()) < size:
        try:
            header = Header.read(inner)
            kind = header.get_uint8("op")
            end = read_uint32(inner) + inner.tell()
        except ReaderError:
            return
        if end > size:
            return
        if kind == RecordType.CONNECTION:
            bag.take_connection(inner, at)
        elif kind == RecordType.MSGDATA:
            yield header.get_uint32("conn"), header.get_time("time"), at
        inner.seek(end)
