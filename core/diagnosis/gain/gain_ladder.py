"""The gain: what naming the cause is worth on sequences that nothing was fitted on.

What counts as an error, and what as the camera's fixed pattern, stands in
`palpate.diagnosis.gain.probe_errors`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
        baseline, extended: of the stated and the extended model.
        noise_floor: what the scatter of single points leaves.
        removed: (value, low, high) of (baseline - extended) / (baseline - noise floor); 95 %
            interval from resampled probes.
        paper: the paper's metric (baseline, extended) [m].
        probes: how many pushes of the tool were resampled.
        force: RMS of measured minus simulated force (baseline, extended, noise floor) [N]; None
            where none was measured.
        tuned: as `removed`, of the stated model with what is known only to its accuracy as fitted,
            and no cause; None if not asked.
    """

    baseline: float
    extended: float
    noise_floor: float
    removed: tuple[float, float, float]
    paper: tuple[float, float]
    probes: int
    force: tuple[float, float, float] | None = None
    tuned: tuple[float, float, float] | None = None


def surface_gain(
    data: Sequence[Observations],
    baseline: Sequence[Prediction],
    extended: Sequence[Prediction],
    stated: Setup,
    found: Setup,
    seed: int,
) -> SurfaceGain:
    """Compare two models on test sequences; probes are resampled whole.

    Groups in touch count, and where a push leaves something (a dent, a block that slid) also those
    after it.
    """
    sums = probe_sums(data, (baseline, extended), found.pushes_leave_traces)
    drawn, whole = sums.rms(sums.draws(seed)), sums.rms()[0]
    low, high = np.quantile(removed_share(*drawn.T), [0.025, 0.975])
    return SurfaceGain(
        baseline=float(whole[0]),
        extended=float(whole[1]),
        noise_floor=float(whole[2]),
        removed=(float(removed_share(*whole)), float(low), float(high)),
        paper=(_paper(data, baseline, stated), _paper(data, extended, found)),
        probes=len(sums.names),
        force=_force(baseline, extended),
    )


def _paper(data: Sequence[Observations], predictions: Sequence[Prediction], setup: Setup) -> float:
    """The paper's metric [m], mean over touched groups."""
    found = list(paper_sums(data, predictions, setup).values())
    return (
        sum(total for total, _ in found) / sum(count for _, count in found)
        if found
        else float("nan")
    )


def _force(
    baseline: Sequence[Prediction], extended: Sequence[Prediction]
) -> tuple[float, float, float] | None:
    """RMS force error (baseline, extended, noise floor) [N] in groups in which the tool of either
    model presses.
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
