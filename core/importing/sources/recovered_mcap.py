"""MCAP files whose recording was cut off: whole records are found by reading on."""

from __future__ import annotations

from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.storage_mcap import McapReader

__all__ = ["RecoveredMcap"]

_MAGIC = b"\x89MCAP0\r\n"
_KNOWN = range(1, 16)
"""Numbers of the kinds of records in version 0 of the format."""
_LAST = (0x02, 0x0F)
"""Footer, and the end of the data section: no messages follow."""


class RecoveredMcap(McapReader):
    """An MCAP file without its end: all whole records of it."""

    def _open(self) -> None:
        """Find the end of the whole records and read all of them; ReaderError where none is."""
        assert self.bio
        bio, size = self.bio, self.path.stat().st_size
        if bio.read(8) != _MAGIC:
            raise ReaderError("File magic is invalid.")
        ends = []
        while (head := bio.read(9)) and len(head) == 9 and head[0] in _KNOWN:
            end = bio.tell() + int.from_bytes(head[1:], "little")
            if head[0] in _LAST or end > size:
                break
            ends.append(end)
            bio.seek(end)
        if len(ends) < 2:
            raise ReaderError("No whole record is there.")
        self.data_start, self.data_end = ends[0], ends[-1]
        self.meta_scan()
        assert self.statistics
        counts = self.statistics.channel_message_counts
        self.connections = [
            one._replace(msgcount=counts.get(one.id, 0)) for one in self.connections
        ]
        if total := self.statistics.message_count:
            first, last = self.statistics.start_time, self.statistics.end_time
            self.metadata = self.metadata._replace(
                duration=last - first + 1, start_time=first, end_time=last + 1, message_count=total
            )
