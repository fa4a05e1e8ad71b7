"""ROS 1 bags, and ROS 2 recordings in sqlite3 or mcap, as folders or bare files."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from functools import cached_property, partial
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.messages.message_kinds import (
    KINDS,
    header_of,
    nested_transforms,
    packed_numbers,
)
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.bag_readers import (
    BAG_SUFFIXES,
    BROKEN,
    open_readers,
    storage_files,
    unknown_coding,
)
from palpate.importing.stream import Sample, Stream

__all__ = ["BagSource"]

_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_PEEKED = 300
"""Messages of tf that are read to list its frames."""


class BagSource:
    """One recording of ROS; its messages are read one by one.

    Attributes:
        path: of the file, or of the folder with metadata.yaml.
        warnings: found on opening and reading.
        has_receipt: whether times of receipt are a clock of their own.
        rules: None, as it is no table.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []
        self.has_receipt = True
        self.rules: ColumnRules | None = None
        self._is_ros2 = path.suffix != ".bag"
        self._readers, found = open_readers(path)
        self.warnings.extend(found)
        self._connections = [one for reader in self._readers for one in reader.connections]
        try:
            self._check_coding()
        except DatasetError:
            self.close()
            raise

    @staticmethod
    def fits(path: Path) -> bool:
        """Whether a path is such a recording, by its name."""
        if path.is_dir():
            return (path / "metadata.yaml").is_file() or bool(storage_files(path))
        return path.suffix in BAG_SUFFIXES

    def files(self) -> tuple[Path, ...]:
        """List the files that hold the messages."""
        if self.path.is_file():
            return (self.path,)
        return tuple(sorted(one for one in self.path.iterdir() if one.is_file()))

    def close(self) -> None:
        """Close the files."""
        for reader in self._readers:
            with suppress(Exception):
                reader.close()

    def streams(self) -> tuple[Stream, ...]:
        """List the topics, sorted, and each frame of tf on its own."""
        return self._streams

    @cached_property
    def _streams(self) -> tuple[Stream, ...]:
        topics: dict[str, list[Any]] = {}
        for one in self._connections:
            topics.setdefault(one.topic, []).append(one)
        found: list[Stream] = []
        for topic, connections in sorted(topics.items()):
            found.extend(self._listed(topic, connections))
        return tuple(found)

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the samples of these streams in order of receipt.

        A damaged place ends the reading, with a warning that says at which time.
        """
        topics = {name.partition("#")[0] for name in names}
        last = 0
        try:
            for connection, received, raw in self.messages(topics):
                last = received
                for sample in self._decoded(connection, received, raw):
                    if sample.stream in names:
                        yield sample
        except BROKEN as error:
            text = f"{self.path.name}: damaged after t = {last / 1e9:.3f} s ({error}); what is "
            self.warnings.append(text + "before it was read")

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Any, int, bytes]]:
        """Read connection, time of receipt [ns] and bytes of the messages of these topics."""
        parts = [
            reader.messages(chosen)
            for reader in self._readers
            if (chosen := [one for one in reader.connections if one.topic in topics])
        ]
        yield from parts[0] if len(parts) == 1 else merge(*parts, key=lambda one: one[1])

    def _decoded(self, connection: Any, received: int, raw: bytes) -> Iterator[Sample]:
        if connection.msgtype in _TRANSFORMS:
            for parent, child, stamp, pose in nested_transforms(
                self._message(connection.msgtype, raw)
            ):
                name = f"{connection.topic}#{child}"
                yield Sample(
                    stream=name,
                    received=received,
                    stamped=stamp,
                    frame=parent,
                    value=partial(np.asarray, pose),
                )
            return
        kind = KINDS[connection.msgtype]
        stamp, frame = header_of(raw, self._is_ros2) if kind.has_header else (0, "")
        yield Sample(
            stream=connection.topic,
            received=received,
            stamped=stamp,
            frame=frame,
            value=partial(self._value, connection, raw, received),
        )

    def _value(self, connection: Any, raw: bytes, received: int) -> FloatArray:
        kind = KINDS[connection.msgtype]
        try:
            if kind.packed:
                return packed_numbers(raw, self._is_ros2, kind.packed)
            message = self._message(connection.msgtype, raw)
        except BROKEN as error:
            raise DatasetError(
                f"{self.path.name}: a message of {connection.topic} at t = {received / 1e9:.3f} s "
                f"is no {connection.msgtype} ({error}); expected a whole one",
                file=self.path.name,
            ) from None
        return kind.decode(message)

    def _message(self, kind: str, raw: bytes) -> Any:
        if self._is_ros2:
            return self._types.deserialize_cdr(raw, kind)
        return self._types.deserialize_ros1(raw, kind)

    @cached_property
    def _types(self) -> Any:
        store = get_typestore(Stores.LATEST if self._is_ros2 else Stores.ROS1_NOETIC)
        for name in _TRANSFORMS:
            if name not in store.types:
                definition = "geometry_msgs/TransformStamped[] transforms"
                store.register(get_types_from_msg(definition, name))
        return store

    def _listed(self, topic: str, connections: list[Any]) -> list[Stream]:
        """Streams of one topic."""
        kinds = {one.msgtype for one in connections}
        count = sum(one.msgcount for one in connections)
        first, last = self._span()
        name = " and ".join(sorted(kinds)).replace("/msg/", "/")
        if len(kinds) == 1 and kinds <= set(_TRANSFORMS) and count:
            return self._listed_frames(topic, name, count, (last - first) / 1e9)
        kind = KINDS.get(next(iter(kinds))) if len(kinds) == 1 else None
        peeked = next(iter(self.samples({topic})), None) if kind is not None and count else None
        frame, delay = self._first_header(topic) if count and len(kinds) == 1 else ("", None)
        return [
            Stream(
                name=topic,
                kind=_kind(kind.kind if kind else "other", topic, peeked),
                message_type=name,
                count=count,
                seconds=(last - first) / 1e9,
                frames=(frame,) if frame else (),
                delay=delay,
            )
        ]

    def _first_header(self, topic: str) -> tuple[str, float | None]:
        """Frame id and delay from stamp to receipt [s] of the first message; of any type that
        begins with a header.
        """
        with suppress(*BROKEN):
            for connection, received, raw in self.messages({topic}):
                kind = self._types.types.get(connection.msgtype)
                if kind is None or next(iter(kind.__dataclass_fields__)) != "header":
                    break
                stamp, frame = header_of(raw, self._is_ros2)
                return frame, (received - stamp) / 1e9 if stamp else None
        return "", None

    def _listed_frames(self, topic: str, name: str, count: int, seconds: float) -> list[Stream]:
        """One stream for each child frame among the first transforms, its parent as frame id."""
        edges: dict[tuple[str, str], int] = {}
        read = 0
        for connection, _, raw in self.messages({topic}):
            for parent, child, _, _ in nested_transforms(self._message(connection.msgtype, raw)):
                edges[child, parent] = edges.get((child, parent), 0) + 1
            read += 1
            if read >= _PEEKED:
                break
        return [
            Stream(
                name=f"{topic}#{child}",
                kind="pose",
                message_type=name,
                count=round(share * count / read),
                seconds=seconds,
                frames=(parent,),
            )
            for (child, parent), share in sorted(edges.items())
        ]

    def _span(self) -> tuple[int, int]:
        """Stamps of the first and the last message [ns]."""
        first = min((reader.start_time for reader in self._readers), default=0)
        last = max((reader.end_time for reader in self._readers), default=0) - 1
        return (first, last) if last >= first else (0, 0)

    def _check_coding(self) -> None:
        """Refuse empty recordings and unknown serialisation, by name."""
        codings = {
            getattr(one.ext, "serialization_format", "cdr") or "cdr" for one in self._connections
        }
        if unknown := sorted(codings - {"cdr", "ros2msg"}):
            raise unknown_coding(self.path, f"Serialization format {unknown} is not supported.")
        if not any(one.msgcount for one in self._connections):
            raise DatasetError(
                f"{self.path.name} holds no messages; expected a recording: record it again",
                file=self.path.name,
            )


def _kind(kind: Any, topic: str, peeked: Sample | None) -> Any:
    """Kind of a stream: colour images are no depth."""
    if kind != "depth" or peeked is None:
        return kind
    try:
        peeked.value()
    except DatasetError:
        return "other"
    return kind
