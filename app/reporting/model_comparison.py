"""Models side by side over sequences: what each is off by, where it was fitted and where it was
not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from palpate.app.storage.run_store import RecordedReplay, Run
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RunError

__all__ = ["SequenceErrors", "compared", "sequence_errors"]

LEAST_REDUCIBLE = 0.02
"""Of the noise floor [1]: of less error above it no share can be said, since the floor itself is
known no better."""


@dataclass(frozen=True)
class SequenceErrors:
    """RMS over the frames of one sequence of the RMS distance between cloud and surface [m]; None
    where no frame was seen.

    Attributes:
        sequence: name.
        split: train, validation or test; None where the run does not say.
        frames: how many were seen.
        raw, extended: of the stated and the extended model.
        noise_floor: what a perfect model would be off by.
    """

    sequence: str
    split: str | None
    frames: int
    raw: float | None
    extended: float | None
    noise_floor: float | None

    @property
    def removed(self) -> float | None:
        """Share of the error above the noise floor that the extended model removes [1], at most
        all; None where hardly any is.
        """
        if self.raw is None or self.extended is None or self.noise_floor is None:
            return None
        if self.raw <= (1 + LEAST_REDUCIBLE) * self.noise_floor:
            return None
        return min(1.0, (self.raw - self.extended) / (self.raw - self.noise_floor))

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**asdict(self), "removed": self.removed}


def sequence_errors(run: Run) -> list[SequenceErrors]:
    """One row for each replayed sequence of a run, those that were fitted on first."""
    splits = run.origin.get("splits", {})
    rows = [_row(run.replay(name), splits.get(name)) for name in run.sequences]
    order = ("train", "validation", "test", None)
    return sorted(
        rows,
        key=lambda row: (
            order.index(row.split) if row.split in order else len(order),
            row.sequence,
        ),
    )


def compared(runs: Sequence[Run]) -> dict[str, Any]:
    """Runs on the same dataset beside each other: by sequence the stated model and the extended one
    of each run [m].

    Raises RunError where there are none, or where they are of different datasets, whose errors say
    nothing of each other.
    """
    if not runs:
        raise RunError("no run is named to compare; name one or more", key="run")
    datasets = {run.name: str(run.report.get("dataset", "?")) for run in runs}
    if len(set(datasets.values())) > 1:
        listed = ", ".join(f"{name} of {dataset}" for name, dataset in datasets.items())
        raise RunError(
            f"runs of one dataset can be compared, these are of several: {listed}",
            run=", ".join(datasets),
        )
    rows = {run.name: {row.sequence: row for row in sequence_errors(run)} for run in runs}
    names = dict.fromkeys(name for own in rows.values() for name in own)
    return {
        "dataset": next(iter(datasets.values())),
        "runs": [
            {"id": run.name, "verdict": run.report.get("verdict"), "causes": _causes(run)}
            for run in runs
        ],
        "sequences": [
            {
                "sequence": name,
                "models": {
                    run: own[name].to_json() if name in own else None for run, own in rows.items()
                },
            }
            for name in names
        ],
    }


def _causes(run: Run) -> list[str]:
    return [cause["effect"] for cause in run.report.get("causes", [])]


def _row(replay: RecordedReplay, split: str | None) -> SequenceErrors:
    raw, extended = (
        np.asarray(replay[f"distance_{model}"], float) for model in ("raw", "extended")
    )
    seen = np.isfinite(raw) & np.isfinite(
        extended
    )  # frames that only one model solved would compare unlike things
    floor = float(replay["noise_floor"])
    return SequenceErrors(
        replay.name,
        split,
        int(seen.sum()),
        _rms(raw[seen]),
        _rms(extended[seen]),
        floor if np.isfinite(floor) else None,
    )


def _rms(values: FloatArray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
