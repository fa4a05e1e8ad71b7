"""The gain of the extended model on held-out sequences with forces and no clouds.

If Young's modulus is no cause, each model has the modulus that fits the forces of its fitted
sequences. A wrong stated modulus would otherwise hide the gain of an inclusion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError

__all__ = ["ForceGain", "force_gain"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceGain:
    """RMS length of measured minus simulated force [N] in contact, and the share of the reducible
    error that is removed.

    Attributes:
        baseline: RMS of the stated model [N].
        extended: RMS of the extended model [N].
        noise_floor: RMS that the sensor's noise and bias alone leave [N].
        removed: (value, low, high) of (baseline - extended) / (baseline - noise floor) [1]; 95 %
            interval from resampled pushes.
        probes: number of pushes that were resampled.
    """

    baseline: float
    extended: float
    noise_floor: float
    removed: tuple[float, float, float]
    probes: int

    def to_json(self, split: str) -> dict[str, Any]:
        """Plain values in millinewtons, as in the report."""
        value, low, high = (round(part, 4) for part in self.removed)
        steps = {
            "baseline": self.baseline,
            "extended": self.extended,
            "noise_floor": self.noise_floor,
        }
        return {
            "split": split,
            "unit": "mN",
            **{name: round(step * 1e3, 3) for name, step in steps.items()},
            "reducible_removed": {"value": value, "low": low, "high": high},
            "probes": self.probes,
            "force": {"unit": "N"} | {name: round(step, 5) for name, step in steps.items()},
        }


def force_gain(
    data: Sequence[Observations],
    baseline: Sequence[Prediction],
    extended: Sequence[Prediction],
    seed: int,
    stiffer: tuple[float, float] = (1.0, 1.0),
) -> ForceGain:
    """Compare two models on held-out sequences; the bootstrap resamples whole pushes.

    Args:
        data: the sequences.
        baseline: their predictions by the stated model.
        extended: their predictions by the extended model.
        seed: of the bootstrap.
        stiffer: Young's modulus of each model over the one that was replayed [1].

    Raises DiagnosisError if no push has a known force.
    """
    rows: list[tuple[str, float, float, float]] = []
    for item, before, after in zip(data, baseline, extended, strict=True):
        if before.forces is None or after.forces is None:
            continue
        for number, group in enumerate(item.groups):
            if (
                number in before.failed
                or number in after.failed
                or not np.isfinite(before.forces.gap[number]).all()
            ):
                continue
            forces = [
                side.scaled(factor)
                for side, factor in zip((before.forces, after.forces), stiffer, strict=True)
            ]
            one, other = (float((side.gap[number] ** 2).sum()) for side in forces)
            rows.append(
                (
                    f"{item.name}/{group.push}",
                    one,
                    other,
                    3 * float(before.forces.noise[number]) ** 2,
                )
            )
    if not rows:
        raise DiagnosisError(
            "the test sequences have no push whose force is known; name others in [splits] test"
        )
    names, table = np.array([row[0] for row in rows]), np.array([[*row[1:], 1.0] for row in rows])
    pushes = np.array([table[names == name].sum(axis=0) for name in np.unique(names)])
    chosen = np.random.default_rng(seed).integers(
        0, len(pushes), size=(CRITERIA.gain.force_draws, len(pushes))
    )
    drawn, whole = _rms(pushes[chosen].sum(axis=1)), _rms(pushes.sum(axis=0)[None])
    low, high = np.quantile(_share(drawn), [0.025, 0.975])
    return ForceGain(
        baseline=float(whole[0, 0]),
        extended=float(whole[0, 1]),
        noise_floor=float(whole[0, 2]),
        removed=(float(_share(whole)[0]), float(low), float(high)),
        probes=len(pushes),
    )


def _rms(sums: FloatArray) -> FloatArray:
    """RMS (d, 3) [N] from sums of squares and, last, the number of groups (d, 4)."""
    return np.asarray(np.sqrt(sums[:, :3] / sums[:, 3:]))


def _share(rms: FloatArray) -> FloatArray:
    """Removed share (d,) of the reducible error, at most 1; 0 if the baseline is at the floor."""
    reducible = rms[:, 0] - rms[:, 2]
    some = reducible > np.sqrt(CRITERIA.gain.least_reducible_force)
    return np.where(
        some, np.minimum((rms[:, 0] - rms[:, 1]) / np.where(some, reducible, 1.0), 1.0), 0.0
    )
