"""Thresholds of the observations: grouping of frames, forces, and outliers."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.diagnosis.criteria.threshold import threshold

__all__ = ["ForceErrorCriteria", "ForceOnlyCriteria", "GroupingCriteria", "OutlierCriteria"]


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
