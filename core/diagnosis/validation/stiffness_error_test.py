"""Is more wrong in some pushes than a replay's own error can be? What of that error a sequence asks
for, against what is usual.

Every model's noise allows for the engine's own error: displacements, and local stiffness, each
smooth and of its own in every sequence (`palpate.diagnosis.inference.noise_model`). It is wide
enough for what no catalogue should be blamed for, so that something outside the catalogue hides in
it: a shaft that leans on the rim in pushes from the side looks like spots that are a sixth too
soft. How much of the allowance a sequence asks for is told by the evidence (MacKay 1992, "Bayesian
interpolation", eq. 4.2) of its data as a function of the local stiffness' deviation. In replays of
data of two other solvers with nothing hidden it is at most half.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import chi2

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block, fit, less_constants, log_evidence
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.noise_model import Noise
from palpate.diagnosis.validation.worst_location import ErrorLocation, location_of
from palpate.foundation.arrays import FloatArray

__all__ = ["StiffnessErrorTest", "chance_bound", "largest_stiffness_error", "stiffness_error_of"]


@dataclass(frozen=True)
class StiffnessErrorTest:
    """Of the sequence that asks for most.

    Attributes:
        sequence: its name.
        factor: deviation of local stiffness that explains it best, over the usual one [1].
        gain: what that gains over the usual one [nats].
        bound: what it would gain once in a thousand datasets where the usual one is true [nats].
        place: where most of what such errors change is seen.
    """

    sequence: str
    factor: float
    gain: float
    bound: float
    place: ErrorLocation

    @property
    def significant(self) -> bool:
        """Whether chance would rarely ask for so much."""
        return self.gain > self.bound

    @property
    def share(self) -> float:
        """Of the variance that is asked for: what is beyond the usual [1]."""
        return 1.0 - self.factor**-2

    @property
    def warning(self) -> str:
        """For people; empty where nothing unusual is asked for."""
        if not self.significant:
            return ""
        usual = 100 * CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error
        return (
            f"{self.sequence} would need local stiffness that is off by {usual * self.factor:.0f} %, in a pattern of its own; a "
            f"replay's own error is like {usual:.0f} % at most: something acts there that is not modelled"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        deviation = CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error * self.factor
        return {
            "sequence": self.sequence,
            "deviation": round(deviation, 4),
            "usual": CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error,
            "gain_nats": round(self.gain, 2),
            "bound_nats": round(self.bound, 2),
        }


def largest_stiffness_error(bench: Bench, model: Model) -> StiffnessErrorTest | None:
    """Of the sequences with clouds; None where there is none."""
    precision = bench.held(model)
    found = []
    for noise, item in zip(bench.noises, model.predictions, strict=True):
        if not item.force_only:
            whole, own = Block(item.name, *noise.whole(item)), noise.discrepancy.shape[2]
            wanted = stiffness_error_of(
                whole, [*model.nuisance, *model.columns], precision, own, noise.spots
            )
            found.append((item.name, wanted, noise))
    if not found:
        return None
    name, wanted, noise = max(found, key=lambda row: row[1].gain)
    place = location_of(
        bench.surface.patch_centres, _seen(noise, wanted.errors)[: bench.surface.patches]
    )
    return StiffnessErrorTest(name, wanted.factor, wanted.gain, chance_bound(len(found)), place)


def _seen(noise: Noise, errors: FloatArray) -> FloatArray:
    """What errors (s,) of local stiffness, over the allowed deviation, change in each row of a
    sequence: squared, over noise.
    """
    pattern = noise.discrepancy[..., -noise.spots :] @ errors
    away = less_constants(pattern[..., None], noise.weights)[..., 0]
    return np.asarray((noise.weights * away**2).sum(axis=0))


def chance_bound(sequences: int) -> float:
    """What one of so many sequences gains by chance once in 1 / FALSE datasets, where the usual
    deviation is true [nats].

    Half of the time less than the usual fits best, which gains nothing, and else as chi squared of
    one freedom does (Self and Liang 1987, case 5).
    """
    return 0.5 * float(chi2.isf(2 * CRITERIA.stiffness_error.false_alarms / sequences, 1))


@dataclass(frozen=True, eq=False)
class StiffnessError:
    """Of one sequence: `factor` and `gain` as of `StiffnessErrorTest`, and the most probable `errors` (s,) of
    local stiffness there, over the deviation that is allowed.
    """

    factor: float
    gain: float
    errors: FloatArray


def stiffness_error_of(
    block: Block, fitted: list[int], precision: FloatArray, own: int, spots: int
) -> StiffnessError:
    """Of a block whose last `own` columns are the engine's error, the last `spots` of them of local
    stiffness.
    """
    count = block.gram.shape[0] - 1
    columns = [*fitted, *range(count - own, count)]
    fixed = len(fitted)

    def prior(move: float, spot: float) -> FloatArray:
        found = np.zeros((len(columns), len(columns)))
        found[:fixed, :fixed] = precision
        deviation = np.array([*[move] * (own - spots), *[spot] * spots])
        found[fixed:, fixed:] = np.diag(deviation**-2)
        return found

    usual = max(
        log_evidence([block], columns, prior(*pair))
        for pair in product(
            CRITERIA.stiffness_error.displacement_deviations,
            CRITERIA.stiffness_error.usual_deviations,
        )
    )
    more, move, spot = max(
        (log_evidence([block], columns, prior(*pair)), *pair)
        for pair in product(
            CRITERIA.stiffness_error.displacement_deviations,
            CRITERIA.stiffness_error.larger_deviations,
        )
    )
    errors = fit([block], columns, prior(move, spot)).change[-spots:]
    return StiffnessError(spot / CRITERIA.stiffness_error.usual, max(more - usual, 0.0), errors)
