"""A recording on one time line: tool path, forces and stamps of clouds in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.importing.clocks.clock_jumps import without_jumps
from palpate.importing.clocks.common_clock import on_common_clock
from palpate.importing.clocks.stream_times import StreamTimes, stream_times
from palpate.importing.clocks.track import Stamps, Track
from palpate.importing.import_notes import ImportNotes
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping

__all__ = ["TimedRecording", "on_one_clock", "timed_recording"]


@dataclass(frozen=True, eq=False, kw_only=True)
class TimedRecording:
    """Streams that were recorded together, on the clock of the poses.

    Attributes:
        name: of the recording.
        pose_times: (n,) [ns].
        positions: (n, 3) tool centre [m], robot frame.
        quaternions: (n, 4) x, y, z, w.
        cloud_rows: (m,) numbers of the kept clouds among all of their stream.
        cloud_times: (m,) [ns].
        wrench_times: (k,) [ns]; empty without forces.
        forces: (k, 3) [N], as recorded but for unit and sign.
        uncertainty: of the clouds' and the forces' times against the poses' [s].
    """

    name: str
    pose_times: Stamps
    positions: FloatArray
    quaternions: FloatArray
    cloud_rows: Stamps
    cloud_times: Stamps
    wrench_times: Stamps
    forces: FloatArray
    uncertainty: float

    @property
    def time(self) -> FloatArray:
        """Times of the poses (n,) [s]."""
        return self.pose_times / 1e9


def timed_recording(
    recording: Recording, mapping: ImportMapping, notes: ImportNotes, report: Report = silent
) -> TimedRecording:
    """Read the chosen streams but for the points of clouds, and bring them to one time line.

    Raises DatasetError where there is no pose, or its frame changes.
    """
    there = {one.name for one in recording.streams()}
    names = {
        name: role != "cloud" for role, name in _roles(recording, mapping).items() if name in there
    }
    return on_one_clock(recording, recording.tracks(names, report), mapping, notes)


def on_one_clock(
    recording: Recording, found: dict[str, Track], mapping: ImportMapping, notes: ImportNotes
) -> TimedRecording:
    """Bring the chosen streams, as read, to one time line.

    Args:
        recording: that holds them.
        found: its tracks by name of the stream, with the values of poses and forces.
        mapping: which of them are taken.
        notes: take what was done.

    Raises DatasetError where there is no pose, or its frame changes.
    """
    streams, roles = mapping.streams, _roles(recording, mapping)
    if roles["pose"] not in found:
        known = ", ".join(one.name for one in recording.streams())
        raise DatasetError(
            f"{recording.name} has no samples of {streams.pose}; it has {known}: name the pose of "
            "the tool",
            key="streams.pose",
            value=streams.pose,
        )
    tracks = {role: found[name] for role, name in roles.items() if name in found}
    _check_frame(recording, tracks["pose"], mapping)
    if mapping.time.stamps == "header":
        tracks = without_jumps(tracks, notes)
    times = {
        role: stream_times(track, notes, use_receipt=mapping.time.stamps == "receipt")
        for role, track in tracks.items()
    }
    times = on_common_clock(tracks, times, "pose", notes)
    timed = _timed(recording.name, tracks, times, mapping, notes)
    if timed.uncertainty:
        notes.decide(
            f"{timed.name}: times of clouds and forces against the poses are uncertain by "
            f"{1e3 * timed.uncertainty:.1f} ms"
        )
    return timed


def _roles(recording: Recording, mapping: ImportMapping) -> dict[str, str]:
    """Names of the chosen streams in a recording, by role."""
    streams = mapping.streams
    return {
        "pose": recording.named(streams.pose, "pose"),
        "cloud": recording.named(streams.cloud, "cloud"),
        "wrench": recording.named(streams.wrench, "wrench"),
    }


def _timed(
    name: str,
    tracks: dict[str, Track],
    times: dict[str, StreamTimes],
    mapping: ImportMapping,
    notes: ImportNotes,
) -> TimedRecording:
    pose_rows, pose_times = times["pose"].rows, times["pose"].times
    poses = tracks["pose"].values[pose_rows]
    good = _whole_poses(tracks["pose"], poses, notes)
    poses, pose_times = poses[good], pose_times[good]
    quaternions = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    positions = poses[:, :3]
    if any(mapping.pose.tool_tip):
        positions = positions + Rotation.from_quat(quaternions).apply(mapping.pose.tool_tip)
    none = np.empty(0, dtype=np.int64)
    cloud = times.get("cloud")
    wrench_times, forces = none, np.empty((0, 3))
    if "wrench" in times:
        forces = mapping.wrench.sign * tracks["wrench"].values[times["wrench"].rows, :3]
        kept = np.isfinite(forces).all(axis=1)
        wrench_times = times["wrench"].times[kept] + _offset(mapping.time.wrench_offset)
        forces = forces[kept]
    return TimedRecording(
        name=name,
        pose_times=pose_times,
        positions=positions,
        quaternions=quaternions,
        cloud_rows=none if cloud is None else cloud.rows,
        cloud_times=none if cloud is None else cloud.times + _offset(mapping.time.cloud_offset),
        wrench_times=wrench_times,
        forces=forces,
        uncertainty=max(one.uncertainty for one in times.values()),
    )


def _whole_poses(track: Track, poses: FloatArray, notes: ImportNotes) -> BoolArray:
    """Whether each pose (n, 7) is finite and has an orientation."""
    norms = np.linalg.norm(poses[:, 3:], axis=1)
    good = np.isfinite(poses).all(axis=1) & (np.abs(norms - 1) < 0.1)
    if lost := int((~good).sum()):
        notes.warn(
            f"{track.stream}: {lost} of {len(poses)} poses are not finite or have no orientation: "
            "dropped"
        )
    if good.sum() < 2:
        raise DatasetError(
            f"{track.stream}: {int(good.sum())} poses are whole; expected two or more, with unit "
            "quaternions: are the columns x, y, z, qx, qy, qz, qw?",
            key="streams.pose",
        )
    return np.asarray(good)


def _check_frame(recording: Recording, track: Track, mapping: ImportMapping) -> None:
    frames = [one for one in track.frames if one]
    wanted = mapping.pose.frame
    if len(frames) > 1 or (wanted and frames and frames != [wanted]):
        raise DatasetError(
            f"{recording.name}: {track.stream} is in the frames {', '.join(frames)}; expected "
            f"{wanted or 'one'} throughout: one registration of the robot holds for one frame",
            key="pose.frame",
            value=frames[0],
        )


def _offset(seconds: float) -> int:
    return round(seconds * 1e9)
