"""Errors of a replayed sequence against the clouds of the same frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.experiment.replayed_sequence import ReplayedSequence
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.recording.record_sequence import ModelRecording, compare_with_clouds

__all__ = ["ReplayComparison", "compare"]


@dataclass(frozen=True, eq=False)
class ReplayComparison:
    """Distances between the measured and the simulated surface, frame by frame.

    Attributes:
        replay: what was compared.
        errors: (f, v) signed error at each vertex of the simulated surface [m], positive where the
            measured surface lies outside; NaN where nothing was seen.
        frame_rms: (f,) RMS over the vertices that were seen [m].
        paper_distance: (f,) mean distance of cloud points to the simulated vertices [m], the metric
            of Wu, Kazanzides and Unberath (2020).
        vertices: (f, v, 3) the simulated surface [m], phantom frame.
    """

    replay: ReplayedSequence
    errors: FloatArray
    frame_rms: FloatArray
    paper_distance: FloatArray
    vertices: FloatArray

    @property
    def rms(self) -> float:
        """RMS error over all frames and vertices that were seen [m]."""
        return float(np.sqrt(np.nanmean(self.errors**2)))


def compare(replay: ReplayedSequence, report: Report = silent) -> ReplayComparison:
    """Compare a replay with the segmented clouds of its frames.

    Raises DatasetError where the sequence has no clouds.
    """
    if replay.cloud_index is None:
        raise DatasetError(
            f"{replay.sequence} has no clouds to compare with; choose another sequence",
            file=f"sequences/{replay.sequence}",
        )
    experiment = replay.experiment
    clouds = experiment.observe(replay.sequence, replay.cloud_index, report).clouds
    seen: ModelRecording = compare_with_clouds(experiment.setup, replay.frames, clouds)
    return ReplayComparison(replay, seen.error, seen.distance, seen.paper, seen.surface)
