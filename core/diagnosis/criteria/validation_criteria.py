"""Thresholds of gain and validation: bootstrap, rejection, engine error, and controls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria.threshold import threshold

__all__ = ["ControlCriteria", "GainCriteria", "RejectionCriteria", "StiffnessErrorCriteria"]


@dataclass(frozen=True, kw_only=True)
class GainCriteria:
    """The gain on test sequences, and its interval."""

    draws: int = threshold(2000, "1", "Bootstrap draws of pushes with clouds.")
    force_draws: int = threshold(2000, "1", "Bootstrap draws of pushes with forces alone.")
    paper_points: int = threshold(
        4000, "1", "Largest number of a group's points in the paper's metric."
    )
    least_points: int = threshold(
        5, "1", "Fewest points of a patch in untouched frames, or its fixed pattern is unknown."
    )
    same_pattern: float = threshold(
        1e-5,
        "m",
        "Fixed patterns that differ by less count as one: the models agree about the untouched "
        "phantom.",
    )
    least_reducible: float = threshold(
        1e-6, "m", "An error above the noise floor by no more than this is not reducible."
    )
    least_reducible_force: float = threshold(1e-12, "N^2", "The same of the force, as its square.")


@dataclass(frozen=True, kw_only=True)
class RejectionCriteria:
    """Bounds for rejecting a cause that the fitted sequences support."""

    added_error: float = threshold(
        0.1,
        "1",
        "A cause is rejected if it surely adds more than this share of the reducible error on "
        "test sequences. Less may be the mesh's error.",
    )
    added_rms: float = threshold(
        1e-4,
        "m",
        "Where test sequences have no reducible error, a cause is rejected if it surely adds more "
        "than this to their RMS error.",
        "derived: the smallest error that matters unless the user sets another tolerance",
    )
    unconfirmed_gain: float = threshold(
        2.0,
        "1",
        "A cause without structured error is a hint if its gain is below this many times the "
        "required gain, and either its numbers may all be as stated or test sequences have no "
        "reducible error. So is a further cause with such numbers.",
        "measured: without structure and without a sure gain a control of another solver named "
        "strain stiffening at 26 to 31 nats for 25; chance gives no 50 nats",
    )
    least_at_rest: float = threshold(
        10.0,
        "nat",
        "Gain on touches and rest cloud from which on they confirm a cause that no push confirms.",
        "measured: over suite 1400 true causes that show at rest gain 12.6 to 5300 there, and "
        "false ones -7 to 3.4; a control with a smoothing filter gained 7.4 with gravity",
    )
    left_share: float = threshold(
        0.5,
        "1",
        "Share of the structure over chance that a cause may leave at most, if it leaves as much "
        "of the reducible error on test sequences.",
        "measured: a softer lump that stood for a second body against the block's side removed "
        "29 % (23 to 47 %) and a quarter of the structure; where a cause was rightly named, "
        "nothing significant was left, or less than a seventh",
    )
    felt: float = threshold(
        3.0,
        "1",
        "Stated forces whose RMS is below this many times the sensor's noise cannot contradict a "
        "verdict.",
    )
    least_forces: int = threshold(4, "1", "Fewer forces than this cannot contradict a verdict.")


@dataclass(frozen=True, kw_only=True)
class StiffnessErrorCriteria:
    """The test whether a sequence needs more engine error than is usual."""

    usual: float = threshold(
        0.5,
        "1",
        "Largest usual deviation of local stiffness, over that which the noise model allows.",
        "measured: six controls of the virtual bench (24 sequences) and block 01 of another solver "
        "need less, or gain less than 1.2 nats by more",
    )
    displacement_deviations: tuple[float, ...] = threshold(
        (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0),
        "1",
        "Deviations of displacement that are tried, over the allowed one.",
    )
    usual_deviations: tuple[float, ...] = threshold(
        (0.05, 0.1, 0.2, 0.35, 0.5),
        "1",
        "Usual deviations of local stiffness that are tried, over the allowed one.",
    )
    larger_deviations: tuple[float, ...] = threshold(
        (0.7, 1.0, 1.4, 2.0, 3.0, 4.0, 6.0),
        "1",
        "Larger deviations of local stiffness that are tried, over the allowed one.",
    )
    false_alarms: float = threshold(
        1e-3, "1", "Share of datasets in which some sequence exceeds the bound by chance."
    )


@dataclass(frozen=True, kw_only=True)
class ControlCriteria:
    """Negative controls of a named cause with falsified motions."""

    most_sequences: int = threshold(3, "1", "Largest number of sequences that are falsified.")
    most_groups: int = threshold(
        6,
        "1",
        "Largest number of groups near the phantom in each of them: those in which the causes "
        "change most.",
    )
    alike: float = threshold(
        0.5,
        "1",
        "Largest share of the cause's pattern that falsified motions may imitate; beyond it the "
        "control says nothing about the cause.",
    )
    retained: float = threshold(
        0.5,
        "1",
        "Largest share of its gain that a cause may retain.",
        "derived: falsified motions that imitate half of the pattern leave a true cause as much",
    )
    faint: float = threshold(
        8.0,
        "nat",
        "Gains up to this count as none.",
        "derived: two standard deviations of a difference of log densities of that size",
    )
    clock_shifts: tuple[float, ...] = threshold(
        tuple(np.arange(0.2, 0.81, 0.05).tolist()),
        "1",
        "Shares of the recording by which a clock is shifted.",
    )
    least_depth_share: float = threshold(
        0.5, "1", "Share of the deepest push that the shifted clouds must still hold."
    )
