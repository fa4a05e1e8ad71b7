"""Thresholds of the observations: grouping of frames, forces, and outliers."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.diagnosis.criteria.threshold import threshold

__all__ = [
    "CameraErrorCriteria",
    "ForceErrorCriteria",
    "ForceOnlyCriteria",
    "GroupingCriteria",
    "OutlierCriteria",
]


def _millimetres(*values: float) -> tuple[float, ...]:
    """Metres of these millimetres."""
    return tuple(value * 1e-3 for value in values)


@dataclass(frozen=True, kw_only=True)
class CameraErrorCriteria:
    """The camera's error in the rest cloud: smooth bias, white scatter, and rippled depth."""

    bias_sizes: tuple[float, ...] = threshold(
        _millimetres(0.15, 0.2, 0.3, 0.4, 0.6, 1.0),
        "m",
        "Standard deviations of the smooth bias that are tried.",
    )
    bias_lengths: tuple[float, ...] = threshold(
        (0.01, 0.014, 0.02, 0.028, 0.04, 0.06),
        "m",
        "Correlation lengths of the smooth bias that are tried.",
    )
    scatter_factors: tuple[float, ...] = threshold(
        (1.0, 1.5, 2.2), "1", "Factors on the scatter's variance that are tried."
    )
    ripple_sizes: tuple[float, ...] = threshold(
        _millimetres(0.05, 0.1, 0.2, 0.4, 0.8),
        "m",
        "Standard deviations of a ripple of depth that are tried.",
    )
    ripple_lengths: tuple[float, ...] = threshold(
        _millimetres(1.5, 2.5, 4.0, 6.0),
        "m",
        "Correlation lengths, along the distance from the camera, of a ripple that are tried.",
    )
    least_ripple_gain: float = threshold(
        12.0,
        "nat",
        "Gain in restricted log likelihood from which on a ripple is reported.",
        "measured: of the virtual bench's rest clouds 12 with rippled depth gain 32 to 111, 12 "
        "with nothing wrong at most 2.2, 28 with another cause at most 2.8; of another solver's "
        "five the best gains 0.7",
    )
    cast_size: float = threshold(
        4e-4, "m", "Standard deviation of a free form's offset from its drawing, where it is tried."
    )
    least_cast_gain: float = threshold(
        12.0,
        "nat",
        "Gain in restricted log likelihood, of an offset of the body alone over an error of the "
        "camera on body and table, from which on the offset's share is no error of the camera.",
    )
    white_floor: float = threshold(
        2e-5, "m", "Standard deviation of a patch's average that no number of points reduces."
    )
    first_smooth_length: int = threshold(
        2,
        "1",
        "Ripples are tried beside a bias of at least this place in `bias_lengths`, because a "
        "rougher bias imitates them.",
    )


@dataclass(frozen=True, kw_only=True)
class GroupingCriteria:
    """Grouping of frames that share one equilibrium."""

    travel: float = threshold(7e-4, "m", "Frames whose tool moved less than this form one group.")
    most_points: int = threshold(
        20000, "1", "Largest number of points of a group with the tool near the phantom."
    )
    most_points_untouched: int = threshold(
        6000,
        "1",
        "Largest number of points of a group with the tool clear of the phantom. There are many "
        "such groups, and together they show how the camera sees the phantom at rest.",
    )
    most_clouds: int = threshold(12, "1", "Largest number of clouds that are read for one group.")
    recovery_times: tuple[float, ...] = threshold(
        (0.5, 1.5, 5.0),
        "s",
        "Times since the last contact at which untouched frames are split into groups, because a "
        "material may recover meanwhile.",
    )
    deeper_by: float = threshold(
        5e-5, "m", "A place of the tool counts as deeper than its group from this difference on."
    )
    path_step: float = threshold(0.02, "s", "Time between sampled places of the tool's path.")
    fitted_groups: int = threshold(
        14, "1", "Largest number of groups near the phantom in a fitted sequence with clouds."
    )
    fitted_force_groups: int = threshold(
        24, "1", "Largest number of groups in a fitted sequence with forces alone."
    )
    test_groups: int = threshold(
        24, "1", "Largest number of groups near the phantom in a test sequence with clouds."
    )
    test_force_groups: int = threshold(
        32, "1", "Largest number of groups in a test sequence with forces alone."
    )


@dataclass(frozen=True, kw_only=True)
class ForceOnlyCriteria:
    """Instants of a push that are compared in sequences with forces and no clouds."""

    depth_shares: tuple[float, ...] = threshold(
        (0.55,), "1", "Depths on the way in that are compared, as shares of the push's depth."
    )
    least_depth: float = threshold(
        0.5e-3, "m", "Shallower contacts are ignored, because their depth is hardly known."
    )
    hold_tolerance: float = threshold(
        1.5e-4, "m", "The tool counts as held while it is within this of its full depth."
    )
    most_hold_instants: int = threshold(8, "1", "Largest number of instants taken from one hold.")
    time_step: float = threshold(0.02, "s", "Time between sampled depths of the tool.")


@dataclass(frozen=True, kw_only=True)
class ForceErrorCriteria:
    """Error of a force: the engine's own, and the sensor's bias."""

    push_error: float = threshold(
        0.03,
        "1",
        "Standard deviation of the engine's relative error of the force, common to a push.",
        "measured: a replay's mesh is 1 to 2 % off, its law and that of another program differ "
        "by as much at these depths, and sensors are calibrated to 1 %",
    )
    group_error: float = threshold(
        0.01,
        "1",
        "Standard deviation of the engine's relative error of the force, independent in each "
        "group.",
        "measured: a replay's mesh is 1 to 2 % off",
    )
    contact_depth: float = threshold(
        1e-4,
        "m",
        "Standard deviation of a push's depth against robot, registration and surface: the "
        "surface's triangles, the first touch as a hand takes it, a tool that is not quite a ball.",
    )
    bias_interval: float = threshold(
        1.0, "s", "Longest time over which an untouched sensor is averaged to one bias reading."
    )
    least_samples: int = threshold(
        20, "1", "Fewest samples of a bias reading, and fewest windows for the sensor's noise."
    )
    fewest_samples: int = threshold(5, "1", "Fewest samples of a bias reading of a slow stream.")
    least_steps: int = threshold(
        4, "1", "Fewest forces in contact by which a push's own constant is told."
    )
    least_range: float = threshold(
        0.5e-3, "m", "Least range of depths by which a push's own constant is told."
    )
    constant_share: float = threshold(
        0.15,
        "1",
        "Standard deviation of what is left of a push's fitted constant, over its largest force.",
        "derived: where the force goes with the depth to the power of 1 to 2 in place of 1.5, or "
        "the depth is a tenth off, the fitted constant is 3 to 14 % off",
    )


@dataclass(frozen=True, kw_only=True)
class OutlierCriteria:
    """Outliers among neighbouring surface patches."""

    hidden_share: float = threshold(
        0.35,
        "1",
        "A patch is nearly hidden if it has less than this share of the median number of points.",
    )
    hidden_points: int = threshold(
        4, "1", "A patch with fewer points than this is nearly hidden in any case."
    )
    neighbour_distance: float = threshold(
        9e-3, "m", "Patches within this distance predict where a patch lies."
    )
    same_side_cosine: float = threshold(
        0.5, "1", "Neighbours have normals whose cosine is larger than this."
    )
    hidden_offset: float = threshold(
        1e-3,
        "m",
        "Largest distance of a nearly hidden patch from its neighbours' median.",
        "derived: a model's error is as smooth as the surface",
    )
    seen_offset: float = threshold(
        6e-3,
        "m",
        "Largest distance of a well-covered patch from its neighbours' median.",
        "derived: a dent at another time or place is a step of some millimetres, no more",
    )
