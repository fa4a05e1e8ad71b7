"""Tables of depth steps at rest as a pose and forces on a made-up time line."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.clocks.track import Stamps
from palpate.importing.rules import SequenceWindow
from palpate.importing.sources.table_source import TableSource
from palpate.importing.stream import Sample, Stream, StreamKind
from palpate.importing.tables.depth_steps import DepthPush, MadeUpTimes, made_up_times, read_pushes

__all__ = ["ProbingSource"]

TOGETHER = 12
"""Pushes of one sequence: about as many as a diagnosis takes of it."""
FEWEST = 3
"""Sequences that are made at least, where there are as many pushes: one for each split."""
ALONG = 0.8
"""Least share of the forces' changes along the normals by which their frame is known [1]; friction
of 0.5 leaves 0.89."""


class ProbingSource(TableSource):
    """One table of depth steps; its streams are those of a table, on a made-up time line.

    Attributes are those of a table.
    """

    @classmethod
    def of(cls, table: TableSource) -> ProbingSource:
        """Make the source of a table that was opened."""
        found = cls.__new__(cls)
        found.path, found.table, found.rules = table.path, table.table, table.rules
        found.stated, found.doubts, found.has_receipt = table.stated, table.doubts, False
        return found

    @property
    def warnings(self) -> list[str]:
        """List the doubts about its columns, and that its times are made up."""
        pushes, left = self._pushes()
        text = (
            f"{self.path.name}: {len(pushes)} pushes in steps of depth; their stamps are made up, "
            "nothing that takes time can be told from them"
        )
        if left:
            text += f"; {left} of {len(self.table)} rows were not reached or alone: left out"
        return [*self.doubts.values(), text]

    def streams(self) -> tuple[Stream, ...]:
        """List the pose and the forces."""
        line = self._line()
        kinds: tuple[tuple[StreamKind, Stamps], ...] = (
            ("pose", line.pose_times),
            ("wrench", line.force_times),
        )
        return tuple(
            Stream(
                name=f"{self.path.name}#{kind}",
                kind=kind,
                message_type="depth steps",
                count=len(times),
                seconds=float(times[-1] - times[0]) / 1e9,
            )
            for kind, times in kinds
        )

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the made-up time line."""
        line = self._line()
        poses = np.concatenate([line.places, line.quaternions], axis=1)
        forces = np.concatenate([line.forces, np.zeros_like(line.forces)], axis=1)
        for kind, times, values in (
            ("pose", line.pose_times, poses),
            ("wrench", line.force_times, forces),
        ):
            name = f"{self.path.name}#{kind}"
            if name in names:
                yield from _samples(name, times, values)

    def windows(self, recording: str, prefix: str) -> tuple[SequenceWindow, ...]:
        """Sequences of some pushes each, spread over the body alike."""
        return tuple(
            SequenceWindow(name=f"{prefix}-{number:02d}", recording=recording, start=start, end=end)
            for number, (start, end) in enumerate(self._line().spans, 1)
        )

    def splits(self, prefix: str) -> dict[str, list[str]]:
        """Half of the sequences to fit, one to validate, the others to test."""
        names = [one.name for one in self.windows("probing", prefix)]
        half = max(1, len(names) // 2)
        return {
            "train": names[:half],
            "validation": names[half : half + 1] if len(names) > 2 else [],
            "test": names[half + 1 :] if len(names) > 2 else names[half:],
        }

    def force_sign(self) -> int:
        """1 where the forces push the tool out along the normals, -1 where they push in, else 0."""
        sums = np.array([push.along for push in self._pushes()[0]])
        share = float(sums[:, 0].sum() / max(sums[:, 1].sum(), 1e-30))
        return int(np.sign(share)) if abs(share) > ALONG else 0

    def _pushes(self) -> tuple[list[DepthPush], int]:
        assert self.rules is not None
        pushes, left = read_pushes(self.table, self.rules)
        if not pushes:
            raise DatasetError(
                f"{self.path.name} holds no push of two rows or more; expected a row for each step "
                "of depth: name push, or nx, ny, nz, in its table of columns",
                file=self.path.name,
            )
        return pushes, left

    def _line(self) -> MadeUpTimes:
        pushes, _ = self._pushes()
        count = min(len(pushes), max(FEWEST, -(-len(pushes) // TOGETHER)))
        return made_up_times([pushes[start::count] for start in range(count)])


def _samples(name: str, times: Stamps, values: FloatArray) -> Iterator[Sample]:
    for row, time in enumerate(times.tolist()):
        yield Sample(
            stream=name,
            received=time,
            stamped=time,
            frame="",
            value=partial(values.__getitem__, row),
        )
