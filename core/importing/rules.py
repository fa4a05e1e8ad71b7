"""Rules of import.toml: which streams are taken, what their numbers mean, and where cuts are."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "ColumnRules",
    "CutRules",
    "ImportMapping",
    "PoseRules",
    "RecordingFiles",
    "RestRules",
    "SequenceWindow",
    "StreamChoice",
    "TimeRules",
    "WrenchRules",
]

Length = Annotated[float, Field(ge=-1.0, le=1.0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]


_AXES = "|".join(
    f"{a}{b}{c}"
    for axes in ("xyz", "XYZ")
    for a in axes
    for b in axes
    for c in axes
    if b not in (a, c)
)
_ROTATION = rf"^(|quaternion|rotation-vector|euler-({_AXES}))$"
"""Ways to write a rotation; no axis twice in a row, and empty where it is not known."""


class _Rules(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class RecordingFiles(_Rules):
    """Files that were recorded together.

    Attributes:
        name: of the recording.
        files: relative to import.toml, or absolute.
    """

    name: Name
    files: tuple[str, ...] = Field(min_length=1)


class StreamChoice(_Rules):
    """Names of the streams that are taken; empty for none.

    Attributes:
        pose: of the tool.
        cloud: point clouds, or depth images.
        camera: camera_info of the depth images.
        wrench: forces.
    """

    pose: str = ""
    cloud: str = ""
    camera: str = ""
    wrench: str = ""


class PoseRules(_Rules):
    """Meaning of the tool's poses.

    Attributes:
        frame: frame id of the robot frame; read from the recording.
        tool_tip: from the pose's origin to the centre of the tool's ball [m], in the frame that
            the pose describes.
    """

    frame: str = ""
    tool_tip: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)


class WrenchRules(_Rules):
    """Meaning of the forces.

    Attributes:
        frame: "robot", or "tool" for a sensor that turns with the tool.
        turn: quaternion x, y, z, w from the sensor's axes to those of the tool's pose.
        zero: "fitted" to the time before the first push, or "none".
        weight: "fitted" where the tool turned enough, or "none".
        sign: -1 where the sensor states the force of the tool on the phantom.
        estimated: whether it is an estimate from motor currents, about 2 N off.
    """

    frame: Literal["", "robot", "tool"] = ""
    turn: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    zero: Literal["fitted", "none"] = "none"
    weight: Literal["fitted", "none"] = "none"
    sign: Literal[1, -1] = 1
    estimated: bool = False


class TimeRules(_Rules):
    """Which stamps count.

    Attributes:
        stamps: "header", or "receipt" where header stamps are wrong.
        cloud_offset: added to the times of clouds [s].
        wrench_offset: added to the times of forces [s].
    """

    stamps: Literal["header", "receipt"] = "header"
    cloud_offset: float = 0.0
    wrench_offset: float = 0.0


class ColumnRules(_Rules):
    """Meaning of a table's columns.

    Attributes:
        columns: column by quantity: t, received, x, y, z, qx, qy, qz, qw, fx, fy, fz, file; q1 to
            q4 for a quaternion by `quaternion_order`; a1 to a3 for the angles of `rotation` in
            its order, or the components of a rotation vector. A column without a name is called
            by its number, the first is "1".
        time_unit: of t.
        length_unit: of x, y, z.
        force_unit: of fx, fy, fz.
        rotation: "quaternion"; "rotation-vector"; or "euler-" and three axes, small letters for
            turns about fixed axes one after the other, capitals about the turned ones, as SciPy
            has it. Roll, pitch and yaw are "euler-xyz"; A, B and C of a KUKA "euler-ZYX".
        angle_unit: of a1, a2, a3.
        quaternion_order: of q1 to q4, "xyzw" or "wxyz"; empty where it is not known.
        rows: "stream", or "depth-steps" where each row is a step of a push at rest, whose time
            does not matter; nx, ny, nz are then the outward normal, push tells one from another.
    """

    columns: dict[str, str]
    time_unit: Literal["s", "ms", "us", "ns", "s+ns"] = "s"
    length_unit: Literal["m", "cm", "mm"] = "m"
    force_unit: Literal["N", "mN"] = "N"
    rotation: Annotated[str, Field(pattern=_ROTATION)] = "quaternion"
    angle_unit: Literal["rad", "deg"] = "rad"
    quaternion_order: Literal["", "xyzw", "wxyz"] = ""
    rows: Literal["stream", "depth-steps"] = "stream"


class CutRules(_Rules):
    """How a recording becomes sequences.

    Attributes:
        cut: one sequence for each push, or one for each recording.
        lead: longest time before the first touch that is kept [s].
        tail: longest time after the release that is kept [s].
        trim: whether idle ends of whole recordings are cut off.
    """

    cut: bool = False
    lead: Annotated[float, Field(ge=0.1, le=60.0)] = 1.5
    tail: Annotated[float, Field(ge=0.1, le=600.0)] = 3.0
    trim: bool = True


class SequenceWindow(_Rules):
    """One sequence: a part of a recording.

    Attributes:
        name: of the sequence.
        recording: it is a part of.
        start: first time that is kept [s], on the clock of the poses.
        end: last time that is kept [s].
        kind: top, side, drag or trace; empty where it is not known.
        split: train, validation or test; "none" for a sequence in none of them. Empty to have it
            proposed; once any sequence states one, those without are in none.
    """

    name: Name
    recording: Name
    start: float
    end: float
    kind: Literal["", "top", "side", "drag", "trace"] = ""
    split: Literal["", "train", "validation", "test", "none"] = ""


class RestRules(_Rules):
    """Source of the rest cloud.

    Attributes:
        file: a cloud; empty for an average of untouched frames.
        recording: whose frames are averaged; empty for the first with untouched ones.
        frames: largest number of frames.
    """

    file: str = ""
    recording: str = ""
    frames: Annotated[int, Field(ge=1, le=200)] = 30


class ImportMapping(_Rules):
    """Everything that an import needs beside the recordings; the content of import.toml.

    Attributes:
        format: version.
        name: of the dataset.
        recordings: files by recording.
        streams: that are taken.
        pose: meaning of poses.
        wrench: meaning of forces.
        time: which stamps count.
        tables: columns by file name.
        cutting: how recordings are cut.
        sequences: cuts; empty to find them.
        rest: where the rest cloud comes from.
        touches: file of touches; empty to find them as dwells.
        traces: file of traces; empty for none.
        setup: tables of dataset.toml: phantom, tool, landmarks, robot, camera, force, motion,
            splits.
        setup_folder: folder of the files that `setup` names.
    """

    format: Literal[1] = 1
    name: Annotated[str, Field(min_length=1, max_length=200)]
    recordings: tuple[RecordingFiles, ...] = Field(min_length=1)
    streams: StreamChoice = StreamChoice()
    pose: PoseRules = PoseRules()
    wrench: WrenchRules = WrenchRules()
    time: TimeRules = TimeRules()
    tables: dict[str, ColumnRules] = {}
    cutting: CutRules = CutRules()
    sequences: tuple[SequenceWindow, ...] = ()
    rest: RestRules = RestRules()
    touches: str = ""
    traces: str = ""
    setup: dict[str, Any] = {}
    setup_folder: str = ""
