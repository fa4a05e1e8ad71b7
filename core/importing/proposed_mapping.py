"""A mapping proposed by names and types of the streams; each choice is said."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.recording import Recording
from palpate.importing.rules import (
    ColumnRules,
    CutRules,
    ImportMapping,
    PoseRules,
    RecordingFiles,
    StreamChoice,
    WrenchRules,
)
from palpate.importing.stream import Stream

__all__ = ["no_pose", "proposed_mapping", "recording_name"]

_POSES = (
    r"(?<!local/)\bmeasured_cp$",
    r"position_cartesian_current$",
    r"local/measured_cp$",
    r"#pose$",
    r"(tool|tip|tcp|pose|gripper|flange|ee)[^/]*$",
    r"setpoint_cp$",
)
"""Names of tool poses, the best first; dVRK 2.x, dVRK 1.x, tables, others."""
_WRENCHES = (r"spatial/measured_cf$", r"body/measured_cf$", r"#wrench$", r"")


def proposed_mapping(
    recordings: Sequence[Recording],
    name: str,
    setup: dict[str, Any],
    tables: dict[str, ColumnRules],
    topics: dict[str, str],
    notes: ImportNotes,
    needs_pose: bool = True,
) -> ImportMapping:
    """Propose which streams are taken and what they mean.

    Args:
        recordings: all of the dataset.
        name: of the dataset.
        setup: tables of dataset.toml.
        tables: meaning of columns, by file.
        topics: streams by role that are stated already.
        notes: take each choice.
        needs_pose: whether a mapping without the pose of a tool is refused.

    Raises DatasetError where no stream is the pose of a tool, and one is needed.
    """
    streams = [stream for one in recordings for stream in one.streams()]
    pose = _stated(streams, topics.get("pose")) or _pose(streams, needs_pose)
    if pose is not None:
        notes.decide(f"pose of the tool: {pose.name}, frame '{_frame(pose)}'")
        _warn_of_pose(pose, streams, notes)
    cloud = _stated(streams, topics.get("cloud")) or _cloud(streams)
    camera = _camera(streams, cloud) if cloud is not None and cloud.kind == "depth" else None
    if cloud is not None:
        by = f" with {camera.name}" if camera else ""
        notes.decide(f"clouds: {cloud.name}{by}, frame '{_frame(cloud)}'")
    wrench = _stated(streams, topics.get("wrench")) or _best(streams, "wrench", _WRENCHES)
    rules = WrenchRules() if wrench is None else _wrench_rules(wrench, pose, notes)
    cut = len(recordings) == 1
    if pose is not None:
        notes.decide(
            "one recording: it is cut into pushes"
            if cut
            else f"{len(recordings)} recordings: each is one sequence"
        )
    return ImportMapping(
        name=name,
        recordings=tuple(
            RecordingFiles(name=one.name, files=tuple(str(s.path) for s in one.sources))
            for one in recordings
        ),
        streams=StreamChoice(
            pose=pose.name if pose else "",
            cloud=cloud.name if cloud else "",
            camera=camera.name if camera else "",
            wrench=wrench.name if wrench else "",
        ),
        pose=PoseRules(frame=_frame(pose) if pose else ""),
        wrench=rules,
        tables=tables,
        cutting=CutRules(cut=cut),
        setup=setup,
    )


def _stated(streams: Sequence[Stream], name: str | None) -> Stream | None:
    if not name:
        return None
    found = next((one for one in streams if one.name == name), None)
    if found is None:
        raise DatasetError(
            f"there is no stream {name}; there are {_listing(streams)}: correct [topics]",
            key="topics",
            value=name,
        )
    return found


def _pose(streams: Sequence[Stream], needed: bool) -> Stream | None:
    found = _best(streams, "pose", _POSES)
    if found is None and needed:
        raise no_pose(streams)
    return found


def no_pose(streams: Sequence[Stream]) -> DatasetError:
    """The error for recordings without the pose of a tool."""
    if any(one.kind == "joints" for one in streams):
        names = ", ".join(dict.fromkeys(one.name for one in streams if one.kind == "joints"))
        text = (
            f"only joint states are there ({names}), which need the robot's kinematics; expected "
            "the pose of the tool: record measured_cp beside them"
        )
        return DatasetError(text, key="streams.pose")
    return DatasetError(
        f"no stream is known as the pose of a tool; there are {_listing(streams)}: name it by "
        "--pose, or in import.toml",
        key="streams.pose",
    )


def _best(streams: Sequence[Stream], kind: str, patterns: Sequence[str]) -> Stream | None:
    """The stream whose name fits the first pattern; of several the one with most samples."""
    for pattern in patterns:
        fitting = [
            one
            for one in streams
            if one.kind == kind and one.count > 1 and re.search(pattern, one.name, re.IGNORECASE)
        ]
        if fitting:
            return max(fitting, key=lambda one: one.count)
    return None


def _cloud(streams: Sequence[Stream]) -> Stream | None:
    clouds = [one for one in streams if one.kind == "cloud" and one.count]
    if clouds:
        return max(clouds, key=lambda one: one.count)
    images = [one for one in streams if one.kind == "depth" and one.count]
    with_camera = [one for one in images if _camera(streams, one) is not None]
    return max(with_camera, key=lambda one: one.count) if with_camera else None


def _camera(streams: Sequence[Stream], image: Stream) -> Stream | None:
    """The camera_info that shares most of its name with the image."""
    cameras = [one for one in streams if one.kind == "camera" and one.count]

    def shared(one: Stream) -> int:
        pairs = zip(one.name.split("/"), image.name.split("/"), strict=False)
        return sum(1 for a, b in pairs if a == b)

    return max(cameras, key=shared) if cameras else None


def _wrench_rules(wrench: Stream, pose: Stream | None, notes: ImportNotes) -> WrenchRules:
    notes.decide(f"forces: {wrench.name}, frame '{_frame(wrench)}'")
    estimated = "measured_cf" in wrench.name
    if estimated:
        notes.warn(
            f"{wrench.name} is an estimate from motor currents, about 2 N off in public work: the "
            "dataset states this as [force] sigma, by which a diagnosis weighs its forces; state "
            "[setup.force] sigma in N if yours are better"
        )
    if wrench.name.endswith("body/measured_cf"):
        notes.decide(f"{wrench.name} turns with the tool")
        return WrenchRules(frame="tool", zero="fitted", estimated=True)
    frame = _frame(pose) if pose else ""
    own_table = wrench.name.endswith("forces.csv#wrench")
    if (
        own_table
        or wrench.name.endswith("spatial/measured_cf")
        or (_frame(wrench) and _frame(wrench) == frame)
    ):
        notes.decide(f"{wrench.name} is in the robot frame")
        return WrenchRules(frame="robot", estimated=estimated)
    notes.warn(
        f"{wrench.name}: its frame '{_frame(wrench)}' is not that of the poses, '{frame}'; "
        'state [wrench] frame as "robot" or "tool"'
    )
    return WrenchRules(estimated=estimated)


def _warn_of_pose(pose: Stream, streams: Sequence[Stream], notes: ImportNotes) -> None:
    if pose.name.endswith("setpoint_cp"):
        notes.warn(f"{pose.name} is the commanded pose, not the measured one")
    if pose.name.endswith("local/measured_cp"):
        notes.warn(f"{pose.name} leaves out the base frame: keep to it in touches and traces")
    others = {one.name for one in streams if one.kind == "pose"} - {pose.name}
    if others:
        notes.decide(f"other poses that are not taken: {', '.join(sorted(others))}")
    notes.decide(
        "tool_tip is 0, 0, 0: the poses are taken as those of the ball's centre; state [pose] "
        "tool_tip if they are not"
    )


def _frame(stream: Stream) -> str:
    return stream.frames[0] if stream.frames else ""


def _listing(streams: Sequence[Stream]) -> str:
    named = dict.fromkeys(f"{one.name} ({one.message_type})" for one in streams)
    return ", ".join(named) or "none"


def recording_name(path: Path) -> str:
    """A name for the recording of a file: letters, digits, dot, dash, underscore."""
    stem = path.name if path.is_dir() else path.stem
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip("-._")[:64]
    return plain or "recording"
