"""Thresholds of the report: verdict, figures, footprint, profiles, and the next probe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria.threshold import threshold

__all__ = [
    "ClueCriteria",
    "DesignCriteria",
    "FigureCriteria",
    "FootprintCriteria",
    "StiffnessMapCriteria",
    "VerdictCriteria",
]


@dataclass(frozen=True, kw_only=True)
class VerdictCriteria:
    """Bounds of the verdict, and of the identifiability of parameters."""

    unexplained_misfit: float = threshold(
        1.25,
        "1",
        "Misfit per value above which structured error is left. The engine's own accuracy is in "
        "the noise already.",
    )
    tolerance: float = threshold(
        1e-4,
        "m",
        "Size (RMS) of structured error from which on it matters, if the user states no other: a "
        "real phantom and a model with the right cause differ by as much.",
        "measured: a control of another solver whose mesh was off by 0.1 mm was called unexplained",
    )
    tolerance_share: float = threshold(
        0.03, "1", "The same as a share of the motion of the visible surface; the larger counts."
    )
    most_modulus_ratio: float = threshold(
        2.0,
        "1",
        "Young's modulus is not identified if its interval reaches above this many times its "
        "value.",
    )
    location_radius: float = threshold(
        8e-3, "m", "Radius of the place around which most of an error is reported."
    )
    profile_fall: float = threshold(
        1.92,
        "nat",
        "Fall of the evidence that ends a 95 % interval.",
        "derived: half the quantile of chi squared with one degree of freedom",
    )
    profile_near: float = threshold(
        2.5,
        "1",
        "First distance at which that fall is looked for, in deviations of the linearised fit.",
        "derived: a parabola falls by 3.1 nats there",
    )
    profile_far: float = threshold(
        6.0,
        "1",
        "Second distance at which that fall is looked for, in deviations of the linearised fit.",
        "derived: a parabola falls by 18 nats there",
    )
    profile_evaluations: int = threshold(
        6, "1", "Largest number of evaluations for all profiles of a model."
    )
    vague: float = threshold(
        1.0,
        "1",
        "Half width of the linearised interval, in the parameter's scale, from which on a "
        "parameter is profiled.",
    )
    takes_part: float = threshold(
        0.3, "1", "Smallest component of a parameter that is named in the weakest direction."
    )


@dataclass(frozen=True, kw_only=True)
class FigureCriteria:
    """Contents of the report's figures."""

    pattern_smoothing: float = threshold(
        3.5e-3, "m", "Standard deviation of the smoothing of error patterns along a side."
    )
    fold: float = threshold(
        1e-3, "m", "Gap between the top of an error pattern and its upright sides."
    )
    least_points: int = threshold(5, "1", "Fewest points behind a shown value of a pattern.")
    least_force_change: float = threshold(
        5.0, "%", "Smallest change of the force that fills the colour scale."
    )
    least_stiffness_change: float = threshold(
        0.1, "1", "Smallest change of the logarithm of a stiffness that fills the colour scale."
    )
    facing: float = threshold(
        0.05, "1", "Cosine to the eye from which on a triangle of the surface is drawn."
    )
    pushed_from: float = threshold(
        0.5, "1", "Cosine of a push to the eye from which on it is drawn in a view."
    )


@dataclass(frozen=True, kw_only=True)
class ClueCriteria:
    """Clues to an error that no cause explains."""

    tool_cell: float = threshold(
        4e-3,
        "m",
        "Width of the cells around the tool in which a pattern that follows it is fitted.",
    )
    significance: float = threshold(
        4.0,
        "1",
        "Nothing is said of what an error moves with unless its sum of squares is this many "
        "standard deviations above what noise gives.",
    )
    lasting_share: float = threshold(
        0.3,
        "1",
        "An error before or after a push that is more than this share of that in contact does not "
        "come from the push alone.",
    )
    least_ratio: float = threshold(
        0.1,
        "1",
        "Smallest error at shallow pushes over that at deep ones that is told apart from 0.",
    )
    worst_frames: int = threshold(3, "1", "Number of the worst frames that are listed.")
    partial_causes: int = threshold(3, "1", "Number of sets of partial causes that are listed.")


@dataclass(frozen=True, kw_only=True)
class FootprintCriteria:
    """The outline of where an inclusion changes the force of a push."""

    rings: tuple[float, ...] = threshold(
        (0.7, 1.3, 2.0, 2.8),
        "1",
        "Distances of the rings of pushes from the middle, in radii of the inclusion.",
    )
    directions: int = threshold(10, "1", "Number of pushes on each ring.")
    level: float = threshold(
        0.5, "1", "The outline lies where the change falls to this share of the largest."
    )
    draws: int = threshold(2000, "1", "Draws of an inclusion for the interval of its depth.")
    along: int = threshold(
        9, "1", "Points on each straight piece of a tube's axis that are compared with the pushes."
    )


@dataclass(frozen=True, kw_only=True)
class StiffnessMapCriteria:
    """The free map of the stiffness."""

    cell: float = threshold(1.0, "1", "Edge of a cell of the map, in radii of the tool.")
    reach: float = threshold(
        3.0, "1", "Distance from a touched place up to which there are cells, in radii of the tool."
    )
    most_cells: int = threshold(400, "1", "Largest number of cells.")
    growth: float = threshold(1.1, "1", "Factor on the edge of the cells while they are too many.")
    lengths: tuple[float, ...] = threshold(
        (1.0, 2.0, 4.0, 8.0),
        "1",
        "Correlation lengths of the stiffness that are tried, in radii of the tool.",
    )
    deviations: tuple[float, ...] = threshold(
        (0.03, 0.06, 0.12, 0.25, 0.5),
        "1",
        "Prior deviations of the contrast (k - 1) / (k + 3/2) of a stiffness ratio k that are "
        "tried.",
    )
    jitter: float = threshold(
        1e-8, "1", "Share of the prior variance that is independent, so that it can be inverted."
    )
    least_weight: float = threshold(
        1e-3, "1", "Prior widths and lengths of a smaller share of the evidence are left out."
    )
    draws: int = threshold(400, "1", "Draws of a uniform body with the data's noise.")
    quantile: float = threshold(
        0.99, "1", "Share of uniform bodies whose map is to be called noise."
    )
    least_gain: float = threshold(
        12.0,
        "nat",
        "Smallest gain over a uniform body of a map that is shown, whatever the draws: the noise "
        "model is not exact.",
        "measured: two uniform bodies gain -1.9 and 3.2, uneven ones 32 to 112",
    )
    most_left: float = threshold(
        0.7,
        "1",
        "Share of the prior deviation that the data may leave of a place that is trusted.",
        "derived: the data then say as much of it as the prior",
    )
    accuracy: float = threshold(
        0.04,
        "1",
        "Deviation of the contrast that the engine's own error leaves, however good the data.",
        "measured: against an independent solver, of the contrast of lumps (suites 301 and 1400); "
        "waves of stiffness of another solver lie in 98 % of the 95 % intervals with it, in 76 % "
        "without",
    )
    carried: float = threshold(
        0.5, "1", "Share of the strongest signal from which a push carries a part of the map."
    )
    joined: float = threshold(1.5, "1", "Distance of the cells of one part, in the longest edge.")
    end_share: float = threshold(
        0.2, "1", "Share of the body's length that is its end, of which is said if it is unfelt."
    )
    end_told: float = threshold(
        0.1, "1", "Smallest trusted share of the surface of an end that is not called unfelt."
    )
    most_spots: int = threshold(5, "1", "Largest number of parts that are listed.")


@dataclass(frozen=True, kw_only=True)
class DesignCriteria:
    """Candidates for the next probe, and how they are judged."""

    shown: int = threshold(3, "1", "Largest number of probes that are proposed.")
    fast: float = threshold(3.0, "1", "Factor on the usual speed where clocks are in question.")
    half_depth_share: float = threshold(
        0.9, "1", "Half the depth is proposed where it gives this share of the nats."
    )
    settled_gap: float = threshold(
        200.0,
        "nat",
        "A rival this far behind the best is not tested: one visit separated the two by so much "
        "that no push needs to.",
    )
    simulated_effects: int = threshold(
        2, "1", "Number of effects at their detection limits that are tested if none was named."
    )
    hold: float = threshold(10.0, "s", "Hold that is tried where a material may have history.")
    spacing: float = threshold(0.016, "m", "Distance between places that are tried, about.")
    margin: float = threshold(
        1.2, "1", "Distance of a place from the edges of its side, in radii of the tool."
    )
    side_height: float = threshold(
        0.6, "1", "Height at which sides are pushed, over the block's height."
    )
    upright: float = threshold(
        0.85, "1", "Height of a free form's normal from which a push counts as one from above."
    )
    reached: float = threshold(
        0.34, "1", "Height of a free form's normal from which a tool reaches the surface."
    )
    drag_length: float = threshold(0.012, "m", "Length of a drag.")
    step: float = threshold(1e-3, "1", "Step of a derivative, in the parameter's scale.")
    white_floor: float = threshold(
        2e-5, "m", "Standard deviation of a patch's average that no number of points reduces."
    )
    least_points: int = threshold(2, "1", "Fewest points of a patch that counts as seen.")
    shaft_places: tuple[float, ...] = threshold(
        tuple(np.linspace(0.0, 0.08, 9).tolist()),
        "m",
        "Places along the shaft at which spheres of the tool's radius stand for it.",
        "derived: the shaft leaves the block the way the tool came",
    )
