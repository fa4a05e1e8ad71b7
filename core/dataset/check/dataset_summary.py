"""Summary of a dataset for `palpate check`: contents, clocks, warnings and missing motions."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from palpate.dataset.check.motion_coverage import CoverageGap, coverage_gaps
from palpate.dataset.check.motion_doubts import motion_doubts
from palpate.dataset.check.plausibility import frame_notes, implausible_values
from palpate.dataset.folder import Dataset
from palpate.dataset.sequence import Sequence
from palpate.dataset.tool_motion import ToolMotion, describe_motion
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.foundation.progress import Report, part, silent
from palpate.setup.depth_filters import DEPTH_FILTERS

__all__ = ["ClockSummary", "DatasetSummary", "SequenceSummary", "check_dataset"]

DROPOUT = 1.8
"""Interval over the median one from which a stamp is missing [1]."""
AT_REST = 0.2
"""Median interval from which rows are depth steps at rest, between which no row is lost [s]."""
WEAK = 0.5
"""Deviation of the forces over their largest change from which they tell little [1]."""
HARMLESS_GAP = 0.02
"""Interval of kinematics and forces in which the tool hardly moves [s]; never a drop-out."""


@dataclass(frozen=True, kw_only=True)
class ClockSummary:
    """Statistics of one column of time stamps.

    Attributes:
        count: number of stamps.
        rate: one over the median interval [Hz]; 0 for fewer than two stamps.
        jitter: standard deviation of the intervals without drop-outs [s].
        dropouts: number of intervals in which at least one stamp is missing.
        longest: longest interval [s].
    """

    count: int
    rate: float
    jitter: float
    dropouts: int
    longest: float


@dataclass(frozen=True, kw_only=True)
class SequenceSummary:
    """Summary of one sequence.

    Attributes:
        name: of the sequence.
        split: of dataset.toml; "none" without one.
        duration: of the kinematics [s].
        kinematics: stamps of the kinematics.
        clouds: stamps of the clouds.
        clouds_outside: number of clouds before or after the kinematics, where the tool's position
            is unknown.
        points: least, median and largest number of points of a cloud; None without clouds.
        forces: stamps of the forces; None without.
        motion: None without a registration of the robot.
    """

    name: str
    split: Literal["train", "validation", "test", "none"]
    duration: float
    kinematics: ClockSummary
    clouds: ClockSummary
    clouds_outside: int
    points: tuple[int, int, int] | None
    forces: ClockSummary | None
    motion: ToolMotion | None


@dataclass(frozen=True, kw_only=True)
class DatasetSummary:
    """Summary of a whole dataset.

    Attributes:
        name: of dataset.toml.
        path: of the folder.
        size: of the phantom [m].
        tool_radius: stated [m].
        touches: names of the touched landmarks.
        rest_points: number of points of the rest cloud; None without one.
        sequences: of each sequence.
        lacks: missing motions and measurements, with the effects that they would show.
        warnings: sentences for a person.
    """

    name: str
    path: str
    size: tuple[float, float, float]
    tool_radius: float
    touches: tuple[str, ...]
    rest_points: int | None
    sequences: tuple[SequenceSummary, ...]
    lacks: tuple[CoverageGap, ...]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, SI units."""
        return asdict(self)


def check_dataset(
    dataset: Dataset,
    phantom_from_robot: Transform | None = None,
    report: Report = silent,
    *,
    was_read: bool = False,
) -> DatasetSummary:
    """Read a whole dataset and sum it up, with a registration of the robot also its motions.

    Args:
        dataset: as opened.
        phantom_from_robot: None without a registration.
        report: progress.
        was_read: whether `Dataset.validate` read every cloud before.
    """
    if not was_read:
        dataset.validate(part(report, 0.0, 0.9))
    summaries = []
    for index, name in enumerate(dataset.sequences):
        report(0.9 + 0.1 * index / len(dataset.sequences), f"looking at {name}")
        summaries.append(_summary(dataset, dataset.sequence(name), phantom_from_robot))
    motions = {summary.name: summary.motion for summary in summaries if summary.motion is not None}
    observed = any(summary.clouds.count for summary in summaries)
    forces = any(summary.forces is not None for summary in summaries)
    report(1.0, "checked")
    return DatasetSummary(
        name=dataset.name,
        path=str(dataset.path),
        size=dataset.config.size,
        tool_radius=dataset.config.tool_radius,
        touches=dataset.touches.names,
        rest_points=len(dataset.rest_cloud()) if dataset.has_rest else None,
        sequences=tuple(summaries),
        lacks=coverage_gaps(motions, observed, forces),
        warnings=(
            *_doubts(dataset),
            *(
                f"{one.name}: {text}"
                for one in summaries
                for text in _sequence_doubts(dataset, one, phantom_from_robot)
            ),
        ),
    )


def _summary(
    dataset: Dataset, sequence: Sequence, phantom_from_robot: Transform | None
) -> SequenceSummary:
    clock, times = sequence.kinematics.time, sequence.cloud_times
    counts = [sequence.count(index) for index in range(len(sequence))]
    return SequenceSummary(
        name=sequence.name,
        split=_split(dataset, sequence.name),
        duration=float(clock[-1] - clock[0]),
        kinematics=_clock(clock, HARMLESS_GAP),
        clouds=_clock(times),
        clouds_outside=int(((times < clock[0]) | (times > clock[-1])).sum()),
        points=(min(counts), int(np.median(counts)), max(counts)) if counts else None,
        forces=_clock(sequence.forces.time, HARMLESS_GAP) if sequence.forces else None,
        motion=describe_motion(dataset, sequence, phantom_from_robot)
        if phantom_from_robot
        else None,
    )


def _clock(times: FloatArray, harmless: float = 0.0) -> ClockSummary:
    if len(times) < 2:
        return ClockSummary(count=len(times), rate=0.0, jitter=0.0, dropouts=0, longest=0.0)
    intervals = np.diff(times)
    median = float(np.median(intervals))
    lost = intervals > max(DROPOUT * median, harmless)
    if harmless and median > AT_REST:
        lost[:] = False
    jitter = float(intervals[~lost].std())
    return ClockSummary(
        count=len(times),
        rate=1 / median,
        jitter=jitter,
        dropouts=int(lost.sum()),
        longest=float(intervals.max()),
    )


def _split(dataset: Dataset, name: str) -> Literal["train", "validation", "test", "none"]:
    for split in ("train", "validation", "test"):
        if name in getattr(dataset.config, split):
            return split
    return "none"


def _doubts(dataset: Dataset) -> list[str]:
    doubts = []
    if not dataset.config.test:
        doubts.append(
            "no sequence is kept for the test, so no gain can be shown: name one in splits.test"
        )
    if dataset.config.synthetic_stamps:
        doubts.append(
            'dataset.toml: motion.stamps = "synthetic": the stamps are no measured times, so that '
            "nothing that takes time, such as relaxation, can be told from these data"
        )
    doubts += _force_doubts(dataset)
    doubts += [f"dataset.toml: {text}" for text in frame_notes(dataset.config)]
    doubts += [
        f"dataset.toml: {text}" for text in implausible_values(dataset.config, dataset.geometry)
    ]
    doubts += [
        f"dataset.toml: camera.filters names {name}: {DEPTH_FILTERS[name].caution}"
        for name in dataset.config.camera_filters
    ]
    if dataset.config.edge:
        doubts.append(
            f"edge-filtered depth: points within {1e3 * dataset.config.edge:.1f} mm of the "
            "phantom's edges are left out of every comparison, and a diagnosis gives no weight to "
            "patches as near to the tool"
        )
    listed = {file for name in dataset.sequences for file in dataset.sequence(name).cloud_files}
    present = {
        path.relative_to(dataset.path).as_posix()
        for path in dataset.path.glob("sequences/*/clouds/*.ply")
    }
    if stray := len(present - listed):
        doubts.append(
            f"{stray} clouds lie in clouds folders without a row in clouds.csv: they are left out"
        )
    return doubts


def _force_doubts(dataset: Dataset) -> list[str]:
    """A warning where forces deviate by as much as they change, by their own statement."""
    sigma = dataset.config.force_sigma
    felt = [one.forces.force for one in dataset.loaded if one.forces is not None]
    if not sigma or not felt:
        return []
    largest = max(float(np.linalg.norm(one - np.median(one, axis=0), axis=1).max()) for one in felt)
    if sigma < WEAK * largest:
        return []
    return [
        f"dataset.toml: force.sigma = {sigma:g} N, and no force changes by more than "
        f"{largest:.2g} N (over {1 / WEAK:g} times the deviation is expected): these forces tell "
        "hardly anything of the stiffness; press deeper, or use a sensor"
    ]


def _sequence_doubts(
    dataset: Dataset, summary: SequenceSummary, phantom_from_robot: Transform | None
) -> list[str]:
    """Warnings about one sequence."""
    doubts = []
    if summary.split == "none":
        doubts.append(
            "is in no split, so it is neither fitted nor tested: add it to one in dataset.toml"
        )
    if summary.clouds_outside:
        doubts.append(
            f"{summary.clouds_outside} of {summary.clouds.count} clouds are stamped outside the "
            "kinematics, where the tool's place "
            "is unknown: do both stamps come from the same clock?"
        )
    doubts += _clock_doubts(summary)
    if summary.points and summary.points[0] < 0.5 * summary.points[1]:
        doubts.append(
            f"the smallest cloud has {summary.points[0]} points, the median one "
            f"{summary.points[1]}: is the view blocked?"
        )
    extent = float(np.ptp(dataset.sequence(summary.name).kinematics.position, axis=0).max())
    if extent < 1e-3:
        doubts.append(
            f"the tool moves by {1e3 * extent:.3f} mm only: is the unit of kinematics.csv the "
            "metre?"
        )
    if summary.motion is None or phantom_from_robot is None:
        return doubts
    sequence = dataset.sequence(summary.name)
    return doubts + motion_doubts(dataset, sequence, summary.motion, phantom_from_robot)


def _clock_doubts(summary: SequenceSummary) -> list[str]:
    doubts = []
    for name, clock in (
        ("clouds", summary.clouds),
        ("kinematics", summary.kinematics),
        ("forces", summary.forces),
    ):
        if clock and clock.dropouts:
            times = "once" if clock.dropouts == 1 else f"{clock.dropouts} times"
            doubts.append(
                f"the {name} pause {times}, at most {clock.longest:.2f} s: frames were lost there"
            )
    if summary.kinematics.rate < summary.clouds.rate:
        doubts.append(
            f"kinematics at {summary.kinematics.rate:.1f} Hz are slower than the clouds at "
            f"{summary.clouds.rate:.1f} Hz"
        )
    return doubts
