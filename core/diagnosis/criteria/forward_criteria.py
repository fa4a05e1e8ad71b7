"""Thresholds of the forward model: replays, comparison along rays, derivatives, and history."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.diagnosis.criteria.threshold import threshold

__all__ = ["DerivativeCriteria", "HistoryCriteria", "RayComparisonCriteria", "ReplayCriteria"]


@dataclass(frozen=True, kw_only=True)
class ReplayCriteria:
    """Tolerances of replays: residual over the tool's push."""

    tolerance: float = threshold(3e-4, "1", "Tolerance of the replays that are fitted and scored.")
    screening_tolerance: float = threshold(
        1e-2,
        "1",
        "Tolerance of the replays that screen effects of a finite size.",
        "measured: the pattern has a correlation of 0.999 with that at 3e-4",
    )
    control_tolerance: float = threshold(
        2e-3, "1", "Tolerance of replays of falsified motions, on the rough mesh."
    )
    design_tolerance: float = threshold(
        1e-3, "1", "Tolerance of the simulated pushes among which the next probe is chosen."
    )
    footprint_tolerance: float = threshold(
        1e-3, "1", "Tolerance of the simulated pushes around an inclusion."
    )


@dataclass(frozen=True, kw_only=True)
class RayComparisonCriteria:
    """Assignment of points to the surface or the tool of a model."""

    tool_reach: float = threshold(
        1.5e-3,
        "m",
        "A point within this of the model's tool may be of the tool. Clouds are cleaned of the "
        "tool where it was stated to be; if it is elsewhere, some of its points remain.",
    )
    tool_margin: float = threshold(
        5e-4,
        "m",
        "A point is of the tool if it is nearer to it than to the surface by more than this.",
    )
    jump: float = threshold(
        3e-3, "m", "A ray whose foot moves by more than this between models has passed over a rim."
    )
    jump_gain: float = threshold(
        1e-3,
        "m",
        "After a jump a point counts from the place beside its ray if that is nearer by more "
        "than this. Without it models would gain by the choice.",
    )
    most_stretch: float = threshold(
        2.0, "1", "Largest factor by which a gap along a ray exceeds the gap to the surface."
    )
    farthest_change: float = threshold(
        8e-3,
        "m",
        "A point whose gap changes by more than this between models has met another side; its "
        "old gap is kept.",
    )


@dataclass(frozen=True, kw_only=True)
class DerivativeCriteria:
    """Steps and limits of derivatives of a replay."""

    most_response: float = threshold(
        1.5,
        "1",
        "The tangent counts as near-singular where the body moves more than this times as far as "
        "the tool; a finite motion then replaces the derivative.",
    )
    tool_span: float = threshold(4e-4, "m", "Half the tool's motion of that finite motion.")
    step: float = threshold(1e-3, "1", "Step of a finite difference, in the parameter's scale.")
    radius_scale: float = threshold(
        3e-4,
        "m",
        "Scale of the tool's radius as a nuisance, of which its derivative's step is a part.",
    )
    camera_scales: tuple[float, ...] = threshold(
        (1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2),
        "m, rad",
        "Scales of the camera's place and rotation as nuisances.",
    )
    poisson_step: float = threshold(
        2e-4,
        "1",
        "Step of a finite difference by Poisson's ratio; backwards above `nearly_incompressible`.",
    )
    nearly_incompressible: float = threshold(
        0.494, "1", "Largest Poisson's ratio with a step forwards."
    )
    least_slip: float = threshold(1e-7, "m", "A base that moved by less has not slid.")


@dataclass(frozen=True, kw_only=True)
class HistoryCriteria:
    """Resolution of the tool's path in replays with history, and their columns."""

    travel: float = threshold(
        2e-3,
        "m",
        "Longest motion between two places near the phantom, for a material's history.",
        "measured: on pushes from above, relaxation and permanent set of 110 um RMS are then 3.8 "
        "and 3.4 um RMS off those by places of 0.5 mm, and 3.1 and 2.6 um by those of 1 mm, with "
        "a quarter more equilibria",
    )
    friction_travel: float = threshold(
        2e-3,
        "m",
        "Longest motion between two places near the phantom, where only the tool's friction has "
        "history.",
        "measured: a drag's effect on the surface is then 8 % off that by places of 0.5 mm, and "
        "4 % by those of 1 mm, in half the time",
    )
    hold: float = threshold(0.4, "s", "Longest time between two places near the phantom.")
    rest_growth: float = threshold(
        1.5,
        "1",
        "Longest time between two places away from the phantom, as a multiple of the time since "
        "the tool left; never shorter than `hold`.",
    )
    trace_step: float = threshold(
        0.25, "1", "Step of a derivative by two traces, in the parameter's scale."
    )
    least_trace_scale: float = threshold(
        0.5, "1", "Smallest factor that fits a trace to the full path-dependent replay."
    )
    most_trace_scale: float = threshold(
        2.0, "1", "Largest factor that fits a trace to the full path-dependent replay."
    )
    replayed_columns: int = threshold(
        3,
        "1",
        "Largest number of times that the columns of a model with history are replayed in a fit.",
    )
    replayed_again: float = threshold(
        25.0,
        "nat",
        "The columns are replayed again where a fit by them gained more.",
        "derived: less is no cause beside the model, for a further cause must gain twice as much",
    )
    most_interpolated: float = threshold(
        3.0, "1", "Largest factor on a group's state at an instant between groups."
    )
