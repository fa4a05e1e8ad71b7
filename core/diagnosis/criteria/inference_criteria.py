"""Thresholds of the inference: stated accuracies, noise, fits, structure, and intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria.threshold import threshold

__all__ = [
    "FitCriteria",
    "IntervalCriteria",
    "NoiseCriteria",
    "PriorCriteria",
    "RestCriteria",
    "StructureCriteria",
]


@dataclass(frozen=True, kw_only=True)
class PriorCriteria:
    """Prior standard deviations: accuracies within which a deviation is no finding."""

    tool_tip: float = threshold(1e-4, "m", "Accuracy of the tool's tip along each axis.")
    tool_radius: float = threshold(5e-5, "m", "Accuracy of the tool's radius.")
    poisson_ratio: float = threshold(0.01, "1", "Accuracy of Poisson's ratio.")
    camera_translation: float = threshold(
        1e-4, "m", "Accuracy of the camera's place along each axis, beyond its covariance."
    )
    camera_rotation: float = threshold(
        2e-3, "rad", "Accuracy of the camera's rotation about each axis, beyond its covariance."
    )
    young_modulus: float = threshold(
        0.03,
        "1",
        "Relative accuracy of Young's modulus where forces were measured.",
        "derived: a cause is named from some seven of these on, so that a modulus within a fifth "
        "of the stated one is no finding; data sheets and castings of one gel differ by as much",
    )
    parameter_steps: float = threshold(
        4.0, "1", "Prior deviation of an effect's parameter, in its scale."
    )
    mesh_multiple: float = threshold(
        4.0,
        "1",
        "Prior deviation of the multiple of the two meshes' difference that the data may need.",
        "derived: edges shrink by a fifth to a half between the meshes, and the rest of an error "
        "that falls with the edge's length is then four times what it fell by",
    )
    flat_factor: float = threshold(
        1e-6, "1", "Factor on a prior's precision that makes the prior flat."
    )
    pinned_factor: float = threshold(
        1e6,
        "1",
        "Factor on the prior precision of a nuisance whose whole change an effect of the model "
        "takes over.",
    )
    bound_precision: float = threshold(
        1e10, "1", "Precision of a parameter that is held at a bound, in its scale."
    )
    at_bound: float = threshold(
        0.05,
        "1",
        "A parameter within this many scales of a bound counts as at the bound.",
        "derived: the shortest step of a fit",
    )


@dataclass(frozen=True, kw_only=True)
class NoiseCriteria:
    """The engine's own error, and the scatter of patch averages."""

    displacement_error: float = threshold(
        0.02,
        "1",
        "Standard deviation of the engine's relative error of displacement, smooth over "
        "`field_length` along the surface.",
    )
    stiffness_error: float = threshold(
        0.08,
        "1",
        "Standard deviation of the logarithm of local stiffness that stands for discretisation "
        "and constitutive law.",
        "measured: replays of data of two other solvers with nothing hidden need at most half",
    )
    field_length: float = threshold(
        8e-3, "m", "Distance between the bumps of the smooth error of displacement."
    )
    white_floor: float = threshold(
        2e-5, "m", "Standard deviation of a patch's average that no number of points reduces."
    )
    other_side_share: float = threshold(
        0.2,
        "1",
        "A patch loses its weight where more than this share of its points meets another side "
        "of the model.",
    )
    mesh_share: float = threshold(
        0.5, "1", "Share of the two meshes' difference that counts as independent scatter."
    )
    shared_significance: float = threshold(
        4.0,
        "1",
        "Noise that the points of a patch share is counted where it is this many standard errors "
        "above zero.",
    )
    isolated: float = threshold(
        5.0,
        "1",
        "An average is an error of a single patch where it differs from its neighbours by this "
        "many standard deviations.",
        "measured: 1 % of the averages of a camera with filled holes, below 0.05 % of those of "
        "other data, also where a cause is hidden",
    )
    calm_share: float = threshold(
        0.8,
        "1",
        "Share of an average's neighbours that differ as little as noise where it alone is off.",
        "derived: a dent of a tool shows in more than a fifth of the patches within 9 mm",
    )
    seen_share: float = threshold(
        0.25,
        "1",
        "An average has no weight where its patch has less than this share of the part of its "
        "group's points that it has where it is seen best.",
    )
    smoothed: float = threshold(
        3e-3,
        "m",
        "Patches this near to the tool have no weight where a filter works that is not stated.",
        "measured: a filter of 1.7 mm raises what is within 2 mm of the tool by 0.2 mm",
    )
    least_freedom: int = threshold(
        50, "1", "A patch with no more degrees of freedom than this gets the median variance."
    )


@dataclass(frozen=True, kw_only=True)
class RestCriteria:
    """The evidence at rest: landmark touches, the rest cloud, and the table."""

    touch_deviation: float = threshold(
        5e-4,
        "m",
        "Standard deviation of one coordinate of a touch: the eye, the hand, and a ball that does "
        "not stay on a corner.",
    )
    least_touches: int = threshold(3, "1", "Fewest touches that are evidence.")
    table_cell: float = threshold(0.012, "m", "Edge of the cells in which the table is averaged.")
    least_table_points: int = threshold(4, "1", "Fewest points of such a cell.")
    pose_freedom: float = threshold(
        0.05,
        "m",
        "Prior deviation of the camera's place in the rest cloud, practically free; ten times as "
        "much in radians of its rotation.",
    )
    least_points: int = threshold(3, "1", "Fewest points of a patch of the rest cloud.")


@dataclass(frozen=True, kw_only=True)
class FitCriteria:
    """Gauss-Newton steps and when a fit ends."""

    trust: float = threshold(2.5, "1", "Longest step of a fit, in the parameters' scales.")
    worth: float = threshold(
        0.5,
        "nat",
        "A step that promises less is not made while models are compared.",
        "derived: the parameters are then within one standard deviation of the best",
    )
    worth_share: float = threshold(
        1e-3,
        "1",
        "Nor is one while models are compared that promises less than this share of the gain over "
        "the stated setup, or than half the distance of rivals if that is less.",
        "derived: models that are nearer to each other are rivals anyway; the accepted one is "
        "fitted again",
    )
    settled: float = threshold(
        0.02,
        "nat",
        "A step that promises less is not made in the last fit.",
        "derived: the parameters are then within 0.2 standard deviations of the best",
    )
    iterations: int = threshold(6, "1", "Largest number of steps.")
    optimism: tuple[float, float] = threshold(
        (10.0, 3.0),
        "1",
        "A fit is given up where this many times its next promised gain would not save it, before "
        "its first step and after it.",
        "measured: to first order a tool's shift by millimetres promises a small part of its gain",
    )
    most_work: tuple[float, float] = threshold(
        (30.0, 50.0),
        "1",
        "A fit of one cause, and of several, ends after solving this many times the equilibria of "
        "one replay of all sequences.",
        "derived: 30 replays are a whole diagnosis of a usual cause; a material with a history "
        "solves several times as many equilibria in one replay",
    )
    least_step: float = threshold(
        0.05, "1", "A fit ends with a shorter step, in the parameters' scales."
    )
    shrinking: float = threshold(
        0.3, "1", "Factor on the length of a step that did not improve the fit."
    )
    least_trust: float = threshold(
        0.1, "1", "A fit ends where its step may be no longer than this, in scales."
    )
    poll_step: float = threshold(
        0.25, "1", "Distance to either side at which a fit with kinks is polled, in scales."
    )
    polls: int = threshold(3, "1", "Largest number of polls that restart a fit.")
    dampings: tuple[float, ...] = threshold(
        tuple(np.geomspace(1e-3, 1e12, 61).tolist()),
        "1",
        "Levenberg-Marquardt dampings that are tried, in the parameters' scales.",
    )


@dataclass(frozen=True, kw_only=True)
class StructureCriteria:
    """The test for structured error in residuals."""

    mode_length: float = threshold(
        12e-3,
        "m",
        "Distance between surface modes.",
        "derived: the effect on the surface of a cause inside a block or at its base is no finer",
    )
    force_mode_length: float = threshold(
        12e-3,
        "m",
        "Distance between modes of the force, over the places that are pushed; a mode is a share "
        "of each push's force.",
    )
    draws: int = threshold(400, "1", "Draws of the null distribution.")
    quantile: float = threshold(
        0.999,
        "1",
        "Quantile of the null distribution, by a gamma distribution with the draws' mean and "
        "variance, above which structure is significant.",
        "derived: at one in a hundred every tenth suite of ten controls would hold a false alarm, "
        "and the noise model is not exact",
    )
    least_precision: float = threshold(
        1e-3,
        "1",
        "Prior precision of a mode's factor over the largest in its block, which keeps a mode "
        "without data from being divided by zero.",
    )


@dataclass(frozen=True, kw_only=True)
class IntervalCriteria:
    """Credible intervals of parameters."""

    level: float = threshold(0.95, "1", "Share of the intervals that hold the truth.")
    normal_quantile: float = threshold(
        1.96,
        "1",
        "Half width of a 95 % interval, in standard deviations.",
        "derived: the normal distribution",
    )
    draws: int = threshold(400, "1", "Draws of a camera's pose for the intervals of magnitudes.")
    least_modulus_factor: float = threshold(
        1e-2,
        "1",
        "Smallest fitted Young's modulus over the stated one. Forces that fit best with the wrong "
        "sign say that there is next to no stiffness.",
    )
    pattern_share: float = threshold(
        10.0, "1", "Prior deviation of the share of a cause's pattern in the data, nearly flat."
    )
