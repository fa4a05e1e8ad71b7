"""Tests whether any sequence needs more engine error than is usual.

The noise model of every sequence allows for the engine's own error: smooth errors of displacement
and of local stiffness (`palpate.diagnosis.inference.noise.noise_model`). They are so wide that a
cause outside the catalogue can hide in them: a shaft that leans on the rim in pushes from the side
looks like spots that are a sixth too soft. The needed deviation of local stiffness maximises the
evidence of the sequence's data (MacKay 1992, "Bayesian interpolation", eq. 4.2). Measured: in
replays of data of two other solvers with nothing hidden it is at most half of the allowed one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import chi2

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, fit, less_constants, log_evidence
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.validation.worst_location import ErrorLocation, location_of
from palpate.foundation.arrays import FloatArray

__all__ = ["StiffnessErrorTest", "chance_bound", "largest_stiffness_error", "stiffness_error_of"]


@dataclass(frozen=True)
class StiffnessErrorTest:
    """The sequence that needs the largest deviation of local stiffness.

    Attributes:
        sequence: its name.
        factor: most probable deviation, over the usual one [1].
        gain: of that deviation over the usual one [nats].
        bound: gain that one in a thousand datasets exceeds by chance [nats].
        place: around which most of the change by such errors lies.
        amplitude: change of the visible surface by the part of them that is not usual, RMS over the
            frames with contact [m].
        motion: RMS displacement of that surface in those frames [m].
    """

    sequence: str
    factor: float
    gain: float
    bound: float
    place: ErrorLocation
    amplitude: float = np.nan
    motion: float = np.nan

    def matters(self, tolerance: Tolerance) -> bool:
        """Whether it is significant and not known to be within the tolerance."""
        return self.significant and not self.amplitude <= tolerance.of(self.motion)

    @property
    def significant(self) -> bool:
        """Whether chance rarely gives so much."""
        return self.gain > self.bound

    @property
    def share(self) -> float:
        """Share of the needed variance beyond the usual one [1]."""
        return 1.0 - self.factor**-2

    @property
    def warning(self) -> str:
        """Sentence for people; empty if nothing unusual is needed."""
        if not self.significant:
            return ""
        usual = 100 * CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error
        return (
            f"{self.sequence} would need local stiffness that is off by "
            f"{usual * self.factor:.0f} %, in a pattern of its own; a replay's own error is like "
            f"{usual:.0f} % at most: something acts there that is not modelled"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values, as in the report."""
        deviation = CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error * self.factor
        return {
            "sequence": self.sequence,
            "deviation": round(deviation, 4),
            "usual": CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error,
            "gain_nats": round(self.gain, 2),
            "bound_nats": round(self.bound, 2),
        }


def largest_stiffness_error(evaluator: Evaluator, model: Model) -> StiffnessErrorTest | None:
    """Test the sequences with clouds; None without them."""
    precision = evaluator.bounded_precision(model)
    results = []
    for noise, item in zip(evaluator.state.noises, model.predictions, strict=True):
        if not item.force_only:
            whole, own = Block(item.name, *noise.whole(item)), noise.discrepancy.shape[2]
            error = stiffness_error_of(
                whole, [*model.nuisance, *model.columns], precision, own, noise.spots
            )
            results.append((item, error, noise))
    if not results:
        return None
    item, error, noise = max(results, key=lambda row: row[1].gain)
    place = location_of(
        evaluator.problem.surface.patch_centres,
        _seen(noise, error.errors)[: evaluator.problem.surface.patches],
    )
    amplitude, motion = _size(evaluator, item, noise, error)
    return StiffnessErrorTest(
        item.name, error.factor, error.gain, chance_bound(len(results)), place, amplitude, motion
    )


def _size(
    evaluator: Evaluator, item: Prediction, noise: Noise, error: StiffnessError
) -> tuple[float, float]:
    """Amplitude and motion [m] as of `StiffnessErrorTest`."""
    centres = evaluator.problem.surface.patch_centres
    touched = np.array([frame.in_contact for frame in item.equilibria])
    seen = (noise.weights[:, : len(centres)] > 0) & touched[:, None]
    if not seen.any():
        return np.nan, np.nan
    pattern = (noise.discrepancy[..., -noise.spots :] @ error.errors)[:, : len(centres)]
    way = np.array(
        [np.linalg.norm(frame.move(centres) - centres, axis=1) for frame in item.equilibria]
    )
    unusual = np.sqrt(max(1.0 - error.factor**-2, 0.0))
    return (
        float(unusual * np.sqrt(np.mean(pattern[seen] ** 2))),
        float(np.sqrt(np.mean(way[seen] ** 2))),
    )


def _seen(noise: Noise, errors: FloatArray) -> FloatArray:
    """Squared change over noise in each row of a sequence by errors (s,) of local stiffness, which
    are over the allowed deviation.
    """
    pattern = noise.discrepancy[..., -noise.spots :] @ errors
    away = less_constants(pattern[..., None], noise.weights)[..., 0]
    return np.asarray((noise.weights * away**2).sum(axis=0))


def chance_bound(sequences: int) -> float:
    """Gain that one of so many sequences exceeds by chance in a share of datasets [nats].

    The share is `CRITERIA.stiffness_error.false_alarms`. Under the usual deviation the gain is zero
    half of the time, and else distributed as half of chi squared with one degree of freedom (Self
    and Liang 1987, case 5).
    """
    return 0.5 * float(chi2.isf(2 * CRITERIA.stiffness_error.false_alarms / sequences, 1))


@dataclass(frozen=True, eq=False)
class StiffnessError:
    """Most probable error of local stiffness of one sequence.

    Attributes:
        factor: deviation over the usual one [1].
        gain: over the usual one [nats].
        errors: (s,) of each spot, over the allowed deviation [1].
    """

    factor: float
    gain: float
    errors: FloatArray


def stiffness_error_of(
    block: Block, fitted: list[int], precision: FloatArray, own: int, spots: int
) -> StiffnessError:
    """Maximise the evidence of one sequence over the deviations of the engine's error.

    Args:
        block: quadratic form of the sequence.
        fitted: its columns of nuisances and causes.
        precision: prior precision of these columns.
        own: number of columns of the engine's error, which are the last ones.
        spots: number of those of local stiffness, which are the last ones of these.
    """
    count = block.gram.shape[0] - 1
    columns = [*fitted, *range(count - own, count)]
    fixed = len(fitted)

    def prior(move: float, spot: float) -> FloatArray:
        matrix = np.zeros((len(columns), len(columns)))
        matrix[:fixed, :fixed] = precision
        deviation = np.array([*[move] * (own - spots), *[spot] * spots])
        matrix[fixed:, fixed:] = np.diag(deviation**-2)
        return matrix

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
