"""Errors of models by sequence, for one run or several."""

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
"""Least error above the noise floor, over the floor [1], for which a share is given; the floor is
known with about this accuracy."""


@dataclass(frozen=True)
class SequenceErrors:
    """RMS over the frames of one sequence of the RMS distance between cloud and surface [m].

    Errors are None where no frame was seen.

    Attributes:
        sequence: name.
        split: train, validation or test; None where the run does not state it.
        frames: number of frames that were seen.
        raw: error of the raw model.
        extended: error of the extended model.
        noise_floor: error of a perfect model.
    """

    sequence: str
    split: str | None
    frames: int
    raw: float | None
    extended: float | None
    noise_floor: float | None

    @property
    def removed(self) -> float | None:
        """Share of the error above the noise floor that the extended model removes [1], at most 1.

        None where there is hardly any.
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
    """One row for each replayed sequence of a run, fitted ones first."""
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
    """Errors [m] of the raw model and of each run's extended one, by sequence.

    Raises RunError for no runs, and for runs of different datasets.
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
    # Only frames that both models solved are comparable.
    seen = np.isfinite(raw) & np.isfinite(extended)
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
