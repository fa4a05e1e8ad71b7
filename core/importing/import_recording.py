"""Import: recordings and a mapping become a dataset folder that is checked and whole."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from palpate.dataset.folder import open_dataset
from palpate.foundation.arrays import BoolArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, part, silent
from palpate.importing.clocks.track import Stamps
from palpate.importing.cutting.pushes import LocatedPhantom, find_pushes, whole_recording
from palpate.importing.cutting.split_proposal import proposed_splits
from palpate.importing.force_in_robot import forces_in_robot
from palpate.importing.import_notes import ImportNotes
from palpate.importing.mapping_file import MAPPING, mapping_text
from palpate.importing.output.earlier_import import EarlierImport, file_digests, window_digest
from palpate.importing.output.recorded_clouds import RecordedClouds
from palpate.importing.output.stated_setup import check_setup, found_phantom, write_setup
from palpate.importing.output.written_dataset import IMPORTED, DatasetWriter
from palpate.importing.recording import Recording, opened_recording
from palpate.importing.rules import CutRules, ImportMapping, SequenceWindow
from palpate.importing.timed_recording import TimedRecording, timed_recording

__all__ = [
    "PROVISIONAL_SPLITS",
    "ImportedDataset",
    "chosen_splits",
    "import_recordings",
    "proposed_windows",
]

PROVISIONAL_SPLITS = {"train": ["provisional"], "validation": [], "test": []}
"""Splits until the sequences are known; a dataset.toml is read only with some."""


@dataclass(frozen=True, kw_only=True)
class ImportedDataset:
    """A finished import.

    Attributes:
        folder: of the dataset.
        mapping: as written to import.toml, with the sequences that were found.
        reused: names of sequences taken over from an earlier import.
    """

    folder: Path
    mapping: ImportMapping
    reused: tuple[str, ...] = field(default=())


def import_recordings(
    mapping: ImportMapping,
    base: Path,
    folder: Path,
    notes: ImportNotes,
    report: Report = silent,
    again: bool = False,
) -> ImportedDataset:
    """Make a dataset of recordings.

    Args:
        mapping: what is taken and what it means.
        base: folder from which the mapping's files are named.
        folder: of the new dataset.
        notes: take decisions and warnings.
        report: of the progress.
        again: replace a dataset that an import made; what did not change is taken over from it.

    Raises DatasetError, and leaves nothing behind then.
    """
    check_setup(mapping)
    writer = DatasetWriter(folder, again)
    recordings: list[Recording] = []
    try:
        for one in mapping.recordings:
            paths = tuple(base / file for file in one.files)
            recordings.append(opened_recording(one.name, paths, mapping.tables))
        run = _Run(mapping, base, writer, notes, EarlierImport.of(folder))
        done = run.imported(recordings, report)
        for recording in recordings:
            for warning in recording.warnings():
                notes.warn(warning)
        open_dataset(writer.folder).validate(part(report, 0.9, 1.0))
        writer.finish()
    finally:
        for recording in recordings:
            recording.close()
        writer.discard()
    return replace(done, folder=folder)


@dataclass
class _Run:
    """One import under way."""

    mapping: ImportMapping
    base: Path
    writer: DatasetWriter
    notes: ImportNotes
    earlier: EarlierImport

    def imported(self, recordings: list[Recording], report: Report) -> ImportedDataset:
        share = 0.4 / len(recordings)
        timed = [
            timed_recording(one, self.mapping, self.notes, part(report, share * n, share * (n + 1)))
            for n, one in enumerate(recordings)
        ]
        write_setup(self.writer, self.mapping, PROVISIONAL_SPLITS, self.base)
        phantom = found_phantom(self.writer, timed, self.notes)
        windows = self.mapping.sequences or proposed_windows(
            timed, phantom, self.mapping.cutting, self.notes
        )
        _check_windows(windows, [one.name for one in recordings])
        splits = chosen_splits(windows, self.mapping, self.notes)
        write_setup(self.writer, self.mapping, splits, self.base)
        report(0.45, "digests of the sources")
        sources = {one.name: file_digests(one.files(), self.earlier) for one in recordings}
        digests = {
            window.name: window_digest(window, sources[window.recording], self.mapping)
            for window in windows
        }
        reused = {
            window.name: old
            for window in windows
            if (old := self.earlier.sequence_with(digests[window.name])) is not None
        }
        share = 0.4 / len(recordings)
        for n, (recording, one) in enumerate(zip(recordings, timed, strict=True)):
            own = [window for window in windows if window.recording == recording.name]
            fresh = [window for window in own if window.name not in reused]
            self._write(
                recording, one, fresh, phantom, part(report, 0.5 + share * n, 0.5 + share * (n + 1))
            )
        for name, old in reused.items():
            self.writer.reused(name, old)
        return self._finished(windows, sources, digests, tuple(reused))

    def _write(
        self,
        recording: Recording,
        timed: TimedRecording,
        windows: list[SequenceWindow],
        phantom: LocatedPhantom | None,
        report: Report,
    ) -> None:
        """Write the sequences of a recording, and the rest cloud where it is the one for it."""
        contacts = phantom.contacts(timed)[0] if phantom is not None else ()
        if len(timed.forces) and windows:
            clear_until = contacts[0].start if contacts else timed.time[-1]
            forces = forces_in_robot(timed, self.mapping.wrench, clear_until, self.notes)
        for window in windows:
            inside = _inside(timed.pose_times, window)
            if inside.sum() < 2:
                raise DatasetError(
                    f"{window.name}: {int(inside.sum())} poses lie from {window.start:.3f} to "
                    f"{window.end:.3f} s; {timed.name} has poses from {timed.time[0]:.3f} to "
                    f"{timed.time[-1]:.3f} s: correct [[sequences]]",
                    key="sequences",
                    value=window.name,
                )
            self.writer.kinematics(
                window.name,
                timed.pose_times[inside],
                timed.positions[inside],
                timed.quaternions[inside],
            )
            felt = _inside(timed.wrench_times, window)
            if felt.any():
                self.writer.forces(window.name, timed.wrench_times[felt], forces[felt])
        clouds = RecordedClouds(recording, timed, self.mapping, self.writer, self.notes)
        clouds.write(windows, phantom, self.base, report)

    def _finished(
        self,
        windows: tuple[SequenceWindow, ...],
        sources: dict[str, dict[str, dict[str, object]]],
        digests: dict[str, str],
        reused: tuple[str, ...],
    ) -> ImportedDataset:
        mapping = self.mapping.model_copy(update={"sequences": windows})
        made = {
            "sources": sources,
            "sequences": {
                name: {"digest": digest, "size": self.writer.size(name)}
                for name, digest in digests.items()
            },
            "decisions": self.notes.decisions,
            "warnings": self.notes.warnings,
        }
        self.writer.text(MAPPING, mapping_text(_from(mapping, self.base)))
        self.writer.text(IMPORTED, json.dumps(made, indent=1, ensure_ascii=False) + "\n")
        return ImportedDataset(folder=self.writer.folder, mapping=mapping, reused=reused)


def proposed_windows(
    timed: Sequence[TimedRecording],
    phantom: LocatedPhantom | None,
    rules: CutRules,
    notes: ImportNotes,
) -> tuple[SequenceWindow, ...]:
    """Cut recordings into pushes, where the rules ask for it and the phantom is known, else make
    each one sequence; `notes` takes each.
    """
    windows: tuple[SequenceWindow, ...] = ()
    if rules.cut and phantom is not None:
        windows = find_pushes(timed, phantom, rules)
        if not windows:
            notes.warn(
                "no push was found: the tool never reaches the phantom by the stated places; "
                "each recording is one sequence"
            )
    if not windows:
        windows = tuple(whole_recording(one, rules) for one in timed)
    for window in windows:
        kind = window.kind or "not cut"
        notes.decide(
            f"{window.name}: {kind}, {window.recording} from {window.start:.2f} to "
            f"{window.end:.2f} s"
        )
    return windows


def chosen_splits(
    windows: Sequence[SequenceWindow], mapping: ImportMapping, notes: ImportNotes
) -> dict[str, list[str]]:
    """Names of the sequences of each split: as the sequences state them, else as the setup does,
    else proposed, which `notes` takes.
    """
    if any(one.split for one in windows):
        return {
            split: [one.name for one in windows if one.split == split]
            for split in ("train", "validation", "test")
        }
    stated: dict[str, list[str]] = mapping.setup.get("splits") or {}
    if stated:
        return stated
    splits = proposed_splits(windows)
    said = "; ".join(f"{key} {', '.join(names) or 'none'}" for key, names in splits.items())
    notes.decide(f"splits: {said}")
    return splits


def _from(mapping: ImportMapping, base: Path) -> ImportMapping:
    """The mapping with absolute files, since it is moved away from them."""
    recordings = tuple(
        one.model_copy(update={"files": tuple(str((base / file).resolve()) for file in one.files)})
        for one in mapping.recordings
    )
    changed: dict[str, object] = {
        "recordings": recordings,
        "setup_folder": str((base / mapping.setup_folder).resolve()),
    }
    for key in ("touches", "traces"):
        if named := getattr(mapping, key):
            changed[key] = str((base / named).resolve())
    if mapping.rest.file:
        file = str((base / mapping.rest.file).resolve())
        changed["rest"] = mapping.rest.model_copy(update={"file": file})
    return mapping.model_copy(update=changed)


def _check_windows(windows: Sequence[SequenceWindow], recordings: Sequence[str]) -> None:
    """Refuse sequences of unknown recordings, and names that come twice."""
    seen: set[str] = set()
    for window in windows:
        if window.recording not in recordings:
            raise DatasetError(
                f"sequence {window.name} is of recording '{window.recording}'; expected one of "
                f"{', '.join(recordings)}: correct [[sequences]]",
                key="sequences",
                value=window.recording,
            )
        if window.name in seen:
            raise DatasetError(
                f"two sequences are named {window.name}; expected each name once: rename one",
                key="sequences",
                value=window.name,
            )
        seen.add(window.name)


def _inside(times: Stamps, window: SequenceWindow) -> BoolArray:
    return np.asarray((times >= window.start * 1e9) & (times <= window.end * 1e9))
