"""The gain of the extended model on held-out sequences with clouds.

`palpate.diagnosis.gain.probe_errors` says what counts as an error and what as the camera's fixed
pattern.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.gain.probe_errors import paper_sums, probe_sums, removed_share
from palpate.diagnosis.observation.force_record import rms_force
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.setup.setup import Setup

__all__ = ["SurfaceGain", "surface_gain"]


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceGain:
    """RMS of patch averages of signed distance [m] in touched frames, and the share of the
    reducible error that is removed.

    Attributes:
        baseline: RMS of the stated model [m].
        extended: RMS of the extended model [m].
        noise_floor: RMS that the scatter of single points leaves [m].
        removed: (value, low, high) of (baseline - extended) / (baseline - noise floor) [1]; 95 %
            interval from resampled pushes.
        paper: the paper's metric (baseline, extended) [m].
        probes: number of pushes that were resampled.
        force: RMS of measured minus simulated force (baseline, extended, noise floor) [N]; None
            without measured forces.
        tuned: as `removed`, for the stated model with fitted nuisances and no cause; None if it was
            not requested.
        added: RMS [m] that the extended model surely has above the larger of baseline and noise
            floor: the lower end of the interval.
    """

    baseline: float
    extended: float
    noise_floor: float
    removed: tuple[float, float, float]
    paper: tuple[float, float]
    probes: int
    force: tuple[float, float, float] | None = None
    tuned: tuple[float, float, float] | None = None
    added: float = 0.0

    def to_json(self, split: str) -> dict[str, Any]:
        """Plain values in millimetres and newtons, as in the report."""
        entry: dict[str, Any] = {
            "split": split,
            "unit": "mm",
            "baseline": round(self.baseline * 1e3, 4),
            "extended": round(self.extended * 1e3, 4),
            "noise_floor": round(self.noise_floor * 1e3, 4),
            "reducible_removed": _interval(self.removed),
            "paper_metric": {
                "baseline": round(self.paper[0] * 1e3, 4),
                "extended": round(self.paper[1] * 1e3, 4),
            },
            "probes": self.probes,
        }
        if self.tuned is not None:
            entry["tuned"] = _interval(self.tuned)
        if self.force is not None:
            names = ("baseline", "extended", "noise_floor")
            entry["force"] = {"unit": "N"} | {
                name: round(value, 5) for name, value in zip(names, self.force, strict=True)
            }
        return entry


def _interval(shares: tuple[float, float, float]) -> dict[str, float]:
    value, low, high = (round(part, 4) for part in shares)
    return {"value": value, "low": low, "high": high}


def surface_gain(
    data: Sequence[Observations],
    baseline: Sequence[Prediction],
    extended: Sequence[Prediction],
    stated_setup: Setup,
    extended_setup: Setup,
    seed: int,
) -> SurfaceGain:
    """Compare two models on held-out sequences; the bootstrap resamples whole pushes.

    Groups in contact count. Where a push leaves a mark (a dent, a block that slid), those after it
    count, too.

    Args:
        data: the sequences.
        baseline: their predictions by the stated model.
        extended: their predictions by the extended model.
        stated_setup: the stated setup.
        extended_setup: the extended setup.
        seed: of the bootstrap.
    """
    sums = probe_sums(data, (baseline, extended), extended_setup.pushes_leave_traces)
    drawn, whole = sums.rms(sums.draws(seed)), sums.rms()[0]
    low, high = np.quantile(removed_share(*drawn.T), [0.025, 0.975])
    before, after, floor = drawn.T
    return SurfaceGain(
        baseline=float(whole[0]),
        extended=float(whole[1]),
        noise_floor=float(whole[2]),
        removed=(float(removed_share(*whole)), float(low), float(high)),
        paper=(_paper(data, baseline, stated_setup), _paper(data, extended, extended_setup)),
        probes=len(sums.names),
        force=_force(baseline, extended),
        added=float(np.quantile(after - np.maximum(before, floor), 0.025)),
    )


def _paper(data: Sequence[Observations], predictions: Sequence[Prediction], setup: Setup) -> float:
    """Mean of the paper's metric over touched groups [m]."""
    sums = list(paper_sums(data, predictions, setup).values())
    return (
        sum(total for total, _ in sums) / sum(count for _, count in sums) if sums else float("nan")
    )


def _force(
    baseline: Sequence[Prediction], extended: Sequence[Prediction]
) -> tuple[float, float, float] | None:
    """RMS force error (baseline, extended, noise floor) [N] in groups in which either model is in
    contact.
    """
    before, after = [], []
    for one, other in zip(baseline, extended, strict=True):
        if one.forces is not None and other.forces is not None:
            touched = [
                a.in_contact or b.in_contact
                for a, b in zip(one.equilibria, other.equilibria, strict=True)
            ]
            before.append((one.forces, np.array(touched)))
            after.append((other.forces, np.array(touched)))
    if not before:
        return None
    raw, floor = rms_force(before)
    return raw, rms_force(after)[0], floor
