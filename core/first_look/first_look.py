"""First look: recordings or a dataset are read once, and their streams, motion and clouds written
for display.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset, Sequence
from palpate.first_look.look_files import LookFiles, LookPath
from palpate.first_look.look_request import LookRequest, is_dataset, opened_sources
from palpate.first_look.recorded_motion import MotionSeries, cloud_choice, without_poses
from palpate.first_look.series import as_list
from palpate.first_look.shown_clouds import REASON_ROWS, write_shown_clouds
from palpate.first_look.staged_dataset import (
    LocatedCamera,
    located_camera,
    staged_clouds,
    staged_dataset,
)
from palpate.first_look.stream_rows import read_tracks, stream_rows, times_of
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError, PalpateError
from palpate.foundation.progress import Report, part, silent
from palpate.importing.clocks.stream_times import StreamTimes
from palpate.importing.cutting.pushes import LocatedPhantom
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import PROVISIONAL_SPLITS, chosen_splits, proposed_windows
from palpate.importing.mapping_file import mapping_text
from palpate.importing.output.stated_setup import check_setup, found_phantom, write_setup
from palpate.importing.output.written_dataset import DatasetWriter
from palpate.importing.proposed_mapping import no_pose
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping, SequenceWindow
from palpate.importing.timed_recording import TimedRecording, on_one_clock

__all__ = ["take_look"]

VERSION = 1
MOST_CLOUDS = 200
"""Clouds of a look."""
MOST_ROWS, ROWS_IN_ALL, FEWEST_ROWS = 2000, 40_000, 200
"""Rows of a series: of one recording, of all together, and the least of each."""
MOST_PLACES = 20_000
"""Places of a tool's path that the scene draws."""


def take_look(request: LookRequest, folder: Path, report: Report = silent) -> dict[str, Any]:
    """Read recordings or a dataset, and write look.json and arrays for display.

    Args:
        request: files, and what is stated about them.
        folder: of the look, which is made; its files are those of `LookFiles`.
        report: of the progress.

    Returns:
        the content of look.json.

    Raises DatasetError where a file cannot be read at all; what is only missing, such as poses, a
    setup or clouds, is left out and said.
    """
    notes = ImportNotes()
    recordings, mapping = opened_sources(request, notes)
    folder.mkdir(parents=True, exist_ok=True)
    writer = DatasetWriter(folder / "staged", again=False)
    try:
        look = _Look(request, LookFiles(folder), mapping, notes, writer)
        return look.taken(recordings, report)
    finally:
        writer.discard()
        for one in recordings:
            one.close()


@dataclass
class _Look:
    """One look under way."""

    request: LookRequest
    files: LookFiles
    mapping: ImportMapping
    notes: ImportNotes
    writer: DatasetWriter
    error: PalpateError | None = None
    streams: list[list[dict[str, Any]]] = field(default_factory=list)
    spans: list[FloatArray] = field(default_factory=list)
    shaft: FloatArray | None = None

    @property
    def of_dataset(self) -> bool:
        """Whether the look is at a dataset."""
        return self.request.mapping is None and is_dataset(self.request.files)

    def taken(self, recordings: list[Recording], report: Report) -> dict[str, Any]:
        """Read everything and write the look's files."""
        if self.of_dataset:
            self.notes.decisions.clear()
        timed = self._timed(recordings, part(report, 0.0, 0.4))
        report(0.4, "robot and phantom")
        stated = self._stated()
        with_poses = [one for one in timed if len(one.pose_times) > 1]
        phantom = None
        if stated:
            phantom = self._checked(found_phantom, self.writer, with_poses, self.notes)
        windows = self._windows(with_poses, phantom)
        report(0.45, "clouds")
        most = int(np.clip(ROWS_IN_ALL // max(1, len(timed)), FEWEST_ROWS, MOST_ROWS))
        series = [MotionSeries(one, phantom, most) for one in timed]
        sequences = self._staged(recordings, series, part(report, 0.45, 0.75))
        dataset = staged_dataset(self.writer.folder, sequences) if stated else None
        located = None
        if dataset is not None:
            located = located_camera(dataset, self.notes, part(report, 0.75, 0.85))
            if located is not None and located.shaft is not None:
                self.shaft = located.shaft.axis
            self.files.write_surface(*dataset.geometry.closed_surface)
        numbers = [
            {float(time / 1e9): at for at, time in enumerate(one.cloud_times.tolist())}
            for one in timed
        ]
        clouds = write_shown_clouds(
            self.files, sequences, numbers, located, part(report, 0.85, 1.0)
        )
        look = {
            **self._head(dataset, located, phantom, any(map(len, sequences))),
            "recordings": [
                self._recording(at, one, clouds[at], windows) for at, one in enumerate(series)
            ],
            "decisions": self.notes.decisions,
            "warnings": self._warnings(recordings),
            "error": None if self.error is None else _told(self.error),
        }
        self.files.write_look(look)
        shutil.rmtree(self.writer.folder, ignore_errors=True)
        return look

    def _timed(self, recordings: Items[Recording], report: Report) -> list[TimedRecording]:
        """All recordings on their clocks; one without poses keeps the times of its clouds."""
        found = []
        for at, one in enumerate(recordings):
            share = part(report, at / len(recordings), (at + 1) / len(recordings))
            tracks = read_tracks(one, share)
            times = times_of(tracks, self.mapping)
            self.streams.append(stream_rows(one, tracks, times, self.mapping))
            self.spans.append(_span(times))
            try:
                if not self.mapping.streams.pose:
                    raise no_pose(one.streams())
                found.append(on_one_clock(one, tracks, self.mapping, self.notes))
            except DatasetError as error:
                self.error = self.error or error
                found.append(without_poses(one.name, self.mapping, times))
        return found

    def _stated(self) -> bool:
        """Write what is stated of the phantom; whether it can be used."""
        if not {"phantom", "tool"} <= set(self.mapping.setup):
            if not self.of_dataset:
                self.notes.decide(
                    "no phantom is stated: nothing is cut into pushes, and clouds are uncleaned"
                )
            return False
        try:
            write_setup(self.writer, self.mapping, PROVISIONAL_SPLITS, Path("/"))
            check_setup(self.mapping)
        except DatasetError as error:
            self.notes.warn(f"setup: {error.message}")
        return self._checked(staged_dataset, self.writer.folder, []) is not None

    def _checked(self, function: Any, *args: Any) -> Any:
        """The function's result; None where the data do not fit, which becomes the look's error."""
        try:
            return function(*args)
        except PalpateError as error:
            self.error = self.error or error
            self.notes.warn(error.message)
            return None

    def _windows(
        self, timed: Items[TimedRecording], phantom: LocatedPhantom | None
    ) -> list[SequenceWindow]:
        """Sequences as the mapping states them, else as an import would cut them, with splits."""
        windows = self.mapping.sequences
        if not windows and timed:
            whole = self.mapping.cutting.model_copy(update={"cut": False, "trim": False})
            rules = whole if self.of_dataset else self.mapping.cutting
            quiet = ImportNotes() if self.of_dataset else self.notes
            windows = proposed_windows(timed, phantom, rules, quiet)
        splits = chosen_splits(windows, self.mapping, ImportNotes())
        split_of = {name: split for split, names in splits.items() for name in names}
        return [one.model_copy(update={"split": split_of.get(one.name, "none")}) for one in windows]

    def _staged(
        self, recordings: Items[Recording], series: Items[MotionSeries], report: Report
    ) -> list[Sequence]:
        """Stage the clouds that are shown."""
        counts = [len(one.timed.cloud_times) for one in series]
        left, total = MOST_CLOUDS, sum(counts) or 1
        found = []
        for at, (recording, one) in enumerate(zip(recordings, series, strict=True)):
            most = min(left, max(1, MOST_CLOUDS * counts[at] // total))
            shown = cloud_choice(one.timed.cloud_times / 1e9, one.deepest(), most)
            left -= len(shown)
            share = part(report, at / len(series), (at + 1) / len(series))
            kept = self._checked(
                staged_clouds, recording, one.timed, shown, self.mapping, one.phantom, self.writer,
                self.notes, share,
            )  # fmt: skip
            found.append(_empty(self.writer.folder, one.timed) if kept is None else kept)
        return found

    def _recording(
        self, at: int, one: MotionSeries, clouds: dict[str, Any], windows: Items[SequenceWindow]
    ) -> dict[str, Any]:
        """One recording of look.json; its path is written beside."""
        timed = one.timed
        if one.has_poses:
            every = 1 + (len(timed.pose_times) - 1) // MOST_PLACES
            path = LookPath(
                timed.time[::every], one.places()[::every], one.axes(self.shaft)[::every]
            )
            self.files.write_path(at, path)
        ends = [times[[0, -1]] for times in (timed.pose_times, timed.cloud_times) if len(times)]
        span = np.concatenate(ends) / 1e9 if ends else self.spans[at]
        return {
            "name": timed.name,
            "start": round(float(span.min()), 6),
            "end": round(float(span.max()), 6),
            "streams": self.streams[at],
            "tool": one.tool(),
            "force": one.force(self.mapping, self.notes),
            "clouds": {"t": as_list(timed.cloud_times / 1e9), **clouds},
            "touches": one.touches(),
            "rest": None if self.of_dataset else one.rest(self.mapping.rest.frames),
            "sequences": [
                window.model_dump(exclude={"recording"})
                for window in windows
                if window.recording == timed.name
            ],
        }

    def _head(
        self,
        dataset: Dataset | None,
        located: LocatedCamera | None,
        phantom: LocatedPhantom | None,
        has_clouds: bool,
    ) -> dict[str, Any]:
        """Source, statements, and the frame in which things are drawn."""
        cleaned = located is not None and located.cleaner is not None
        tool = "robot" if phantom is None else "phantom"
        frame = ("camera" if located is None else "phantom") if has_clouds else tool
        return {
            "version": VERSION,
            "source": {
                "kind": "dataset" if self.of_dataset else "recording",
                "files": [self._named(str(path)) for path in self.request.files],
                "name": self.request.name,
                "dataset": self.request.files[0].name if self.of_dataset else None,
            },
            "mapping": None if self.of_dataset else mapping_text(self._portable()),
            "setup_stated": dataset is not None,
            "length_unit": "m",
            "frame": frame,
            "cleaned": cleaned,
            "reasons": REASON_ROWS if cleaned else [],
            "tool_radius": None if dataset is None else dataset.config.tool_radius,
            "eye": None if located is None else as_list(located.pose.translation),
        }

    def _portable(self) -> ImportMapping:
        """The mapping with its files as the look names them."""
        rest = self.mapping.rest
        return self.mapping.model_copy(
            update={
                "recordings": tuple(
                    one.model_copy(update={"files": tuple(map(self._named, one.files))})
                    for one in self.mapping.recordings
                ),
                "touches": self._named(self.mapping.touches),
                "traces": self._named(self.mapping.traces),
                "rest": rest.model_copy(update={"file": self._named(rest.file)}),
                "setup_folder": self._named(self.mapping.setup_folder),
            }
        )

    def _named(self, file: str) -> str:
        """A file relative to the request's base where it lies below, else as it is."""
        base = self.request.base
        path = Path(file)
        inside = bool(file) and base is not None and path.is_relative_to(base)
        return path.relative_to(base).as_posix() if inside and base is not None else file

    def _warnings(self, recordings: Items[Recording]) -> list[str]:
        for one in recordings:
            for warning in one.warnings():
                self.notes.warn(warning)
        return self.notes.warnings


def _span(times: dict[str, StreamTimes]) -> FloatArray:
    """First and last time [s] of any stream; zeros without any."""
    ends = [one.times[[0, -1]] for one in times.values() if len(one.times)]
    return np.concatenate(ends) / 1e9 if ends else np.zeros(1)


def _empty(root: Path, timed: TimedRecording) -> Sequence:
    """A staged sequence without clouds."""
    from palpate.dataset import Kinematics

    path = Kinematics(timed.time, timed.positions, timed.quaternions)
    return Sequence(root, timed.name, path, np.empty(0), (), None)


def _told(error: PalpateError) -> dict[str, Any]:
    where = {key: value for key, value in error.where.items() if isinstance(value, str | int)}
    return {"message": error.message, "where": where}
