"""The second pass over a recording: clouds of its sequences, and the rest cloud."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report
from palpate.importing.cutting.pushes import LocatedPhantom
from palpate.importing.cutting.rest_average import averaged_cloud, untouched_clouds
from palpate.importing.import_notes import ImportNotes
from palpate.importing.messages.pinhole_camera import PinholeCamera
from palpate.importing.messages.point_cloud import unmeasured
from palpate.importing.output.written_dataset import DatasetWriter
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping, SequenceWindow
from palpate.importing.sources.cloud_file import read_cloud_file
from palpate.importing.timed_recording import TimedRecording

__all__ = ["RecordedClouds"]


@dataclass
class RecordedClouds:
    """Clouds of one recording on their way into a dataset.

    Attributes:
        recording: that holds them.
        timed: the same on one time line.
        mapping: what is taken.
        writer: of the dataset.
        notes: take what was done.
        only: numbers of the clouds in `timed` that are written; None for all.
        most: points of a cloud that are written, evenly chosen; None for all.
    """

    recording: Recording
    timed: TimedRecording
    mapping: ImportMapping
    writer: DatasetWriter
    notes: ImportNotes
    only: frozenset[int] | None = None
    most: int | None = None
    _rest: list[FloatArray] = field(default_factory=list)

    def write(
        self,
        windows: list[SequenceWindow],
        phantom: LocatedPhantom | None,
        base: Path,
        report: Report,
    ) -> None:
        """Write the clouds of these sequences, and rest.ply where there is none yet."""
        resting = self._resting(phantom, base)
        wanted: dict[int, list[tuple[str, int]]] = {}
        times = self.timed.cloud_times
        for window in windows:
            inside = np.flatnonzero((times >= window.start * 1e9) & (times <= window.end * 1e9))
            for at in inside.tolist():
                if self.only is not None and at not in self.only:
                    continue
                row = int(self.timed.cloud_rows[at])
                wanted.setdefault(row, []).append((window.name, int(times[at])))
        if wanted or resting:
            self._pass(wanted, resting, report)
        for window in windows:
            self.writer.clouds_listed(window.name)
            self._say_losses(window.name)
        if self._rest:
            points, how = averaged_cloud(self._rest)
            self.writer.rest(points)
            self.notes.decide(f"rest.ply: {how}")

    def _resting(self, phantom: LocatedPhantom | None, base: Path) -> set[int]:
        """Numbers of the clouds that make up the rest cloud; writes one that is a file."""
        rules = self.mapping.rest
        if (self.writer.folder / "rest.ply").exists():
            return set()
        if rules.file:
            self.writer.rest(read_cloud_file(base / rules.file))
            return set()
        if not len(self.timed.cloud_rows) or rules.recording not in ("", self.recording.name):
            return set()
        chosen, how = untouched_clouds(self.timed, phantom, rules.frames)
        if len(chosen):
            seen = self.timed.cloud_times[chosen] / 1e9
            self.notes.decide(
                f"rest.ply: {len(chosen)} clouds of {self.recording.name} from t = {seen[0]:.2f} "
                f"to {seen[-1]:.2f} s, {how}"
            )
        return {int(row) for row in self.timed.cloud_rows[chosen]}

    def _pass(
        self, wanted: dict[int, list[tuple[str, int]]], resting: set[int], report: Report
    ) -> None:
        last = max([*wanted, *resting])
        camera: PinholeCamera | None = None
        name = self.recording.named(self.mapping.streams.cloud, "cloud")
        for row, sample in enumerate(self.recording.samples(name)):
            if row > last:
                break
            if row not in wanted and row not in resting:
                continue
            points = sample.value()
            if points.ndim == 2 and self.mapping.streams.camera:
                camera = camera or self._camera()
                points = camera.points(points)
            for name, time in wanted.get(row, ()):
                self.writer.cloud(name, time, self._thinned(points))
            if row in resting:
                self._rest.append(points.astype(np.float32))
            report(row / max(1, last), f"{self.recording.name}: cloud {row + 1} of {last + 1}")

    def _thinned(self, points: FloatArray) -> FloatArray:
        """Points (..., 3) [m], or an even choice (n, 3) among them."""
        if self.most is None or points.size <= 3 * self.most:
            return points
        seen = points.reshape(-1, 3)
        seen = seen[~unmeasured(seen)]
        return seen[:: 1 + (len(seen) - 1) // self.most] if len(seen) else seen

    def _camera(self) -> PinholeCamera:
        """The camera by the first of its camera_info."""
        name = self.mapping.streams.camera
        sample = next(iter(self.recording.samples(name)), None)
        if sample is None:
            raise DatasetError(
                f"{self.recording.name} has no {name}; expected the camera_info of its images",
                key="streams.camera",
                value=name,
            )
        numbers = sample.value()
        size = (int(numbers[0]), int(numbers[1]))
        return PinholeCamera.from_numbers(size, numbers[2:11], numbers[11:])

    def _say_losses(self, name: str) -> None:
        if far := self.writer.dropped.get(name):
            self.notes.warn(f"{name}: {far} points lie beyond 10 m: left out")
        if empty := self.writer.empty.get(name):
            self.notes.warn(f"{name}: {empty} clouds hold no point at all: left out")
