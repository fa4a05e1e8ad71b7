"""A dataset of the shown clouds only, aside, so that registration and cleaning are those of every
dataset.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.dataset import Dataset, Kinematics, Sequence
from palpate.dataset.contact_points import Touches, read_touches, read_traces
from palpate.dataset.folder import stated
from palpate.foundation.errors import PalpateError
from palpate.foundation.frames import Transform
from palpate.foundation.progress import Report
from palpate.importing.cutting.pushes import LocatedPhantom
from palpate.importing.import_notes import ImportNotes
from palpate.importing.output.recorded_clouds import RecordedClouds
from palpate.importing.output.written_dataset import DatasetWriter
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping, SequenceWindow
from palpate.importing.timed_recording import TimedRecording
from palpate.measurement.segmentation import Cleaner, cleaner_for
from palpate.measurement.tool_pose import ToolShaft, find_shaft
from palpate.registration.registration import Registration, register

__all__ = ["LocatedCamera", "located_camera", "staged_clouds", "staged_dataset"]

_MOST_POINTS = 120_000
"""Points of a staged cloud; the camera of an ordinary bench has no more of them on the phantom."""


@dataclass(frozen=True, eq=False)
class LocatedCamera:
    """Relation of the clouds to the phantom.

    Attributes:
        pose: phantom_from_camera, registered or as stated.
        cleaner: of the clouds; None where nothing was registered.
        shaft: of the tool, in its frame; None where it is not seen.
        robot: phantom_from_robot by which the tool is found in the clouds; None without.
    """

    pose: Transform
    cleaner: Cleaner | None = None
    shaft: ToolShaft | None = None
    robot: Transform | None = None


def staged_clouds(
    recording: Recording,
    timed: TimedRecording,
    shown: list[int],
    mapping: ImportMapping,
    phantom: LocatedPhantom | None,
    writer: DatasetWriter,
    notes: ImportNotes,
    report: Report,
) -> Sequence:
    """Write the shown clouds of a recording, and the rest cloud where there is none yet.

    Returns:
        the sequence of all poses and of the clouds that hold points.
    """
    clouds = RecordedClouds(
        recording, timed, mapping, writer, notes, only=frozenset(shown), most=_MOST_POINTS
    )
    if len(timed.cloud_times) and shown:
        times = timed.cloud_times / 1e9
        window = SequenceWindow(
            name=timed.name,
            recording=timed.name,
            start=float(times[0]) - 1.0,
            end=float(times[-1]) + 1.0,
        )
        clouds.write([window], phantom if len(timed.pose_times) > 1 else None, Path("/"), report)
    listed = writer.listed(timed.name)
    return Sequence(
        root=writer.folder,
        name=timed.name,
        kinematics=Kinematics(timed.time, timed.positions, timed.quaternions),
        cloud_times=np.array([time for time, _ in listed]) / 1e9,
        cloud_files=tuple(file for _, file in listed),
        forces=None,
    )


def staged_dataset(root: Path, sequences: list[Sequence]) -> Dataset:
    """The dataset of what was written to a folder."""
    config, geometry = stated(root)
    touches = Touches((), np.zeros((0, 3)))
    if (root / "touches.csv").exists():
        touches = read_touches(root, config)
    has_rest = (root / "rest.ply").exists()
    with_poses = tuple(one for one in sequences if len(one.kinematics.time) > 1)
    return Dataset(root, config, touches, has_rest, with_poses, geometry, read_traces(root))


def located_camera(dataset: Dataset, notes: ImportNotes, report: Report) -> LocatedCamera | None:
    """Relate the clouds to the phantom by the rest cloud; else by the stated guess, without
    cleaning; None where neither is there.
    """
    config = dataset.config
    try:
        if dataset.has_rest and dataset.observed and config.has_camera:
            return _registered(dataset, register(dataset, report), notes)
    except PalpateError as error:
        notes.warn(f"clouds are shown uncleaned, as they cannot be registered: {error.message}")
    return None if config.to_phantom is None else LocatedCamera(config.to_phantom)


def _registered(dataset: Dataset, found: Registration, notes: ImportNotes) -> LocatedCamera:
    for warning in found.warnings:
        notes.warn(warning)
    return LocatedCamera(
        found.phantom_from_camera,
        cleaner_for(dataset, found),
        find_shaft(dataset, found.repaired),
        found.repaired.phantom_from_robot,
    )
