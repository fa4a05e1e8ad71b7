"""Comparison of all that a registered dataset says twice: sentences where it contradicts itself."""

from __future__ import annotations

from palpate.consistency.camera_agreement import camera_doubts
from palpate.consistency.force_agreement import force_doubts, sensor_doubts
from palpate.consistency.rest_agreement import rest_doubts
from palpate.consistency.seen_tool import seen_tools
from palpate.consistency.stream_faults import stream_doubts
from palpate.consistency.tool_frame import tool_frame_doubts
from palpate.dataset import Dataset
from palpate.registration.registration import Registration

__all__ = ["check_consistency"]


def check_consistency(dataset: Dataset, registration: Registration | None) -> tuple[str, ...]:
    """Compare streams, forces, clouds and robot of a dataset with each other.

    Args:
        dataset: as opened, not yet aligned with where the phantom stood in each sequence.
        registration: of this dataset; without one only the streams are looked at.

    Returns:
        one sentence for each contradiction, with the number that shows it, its bound, and what to
        do.
    """
    doubts = (*stream_doubts(dataset), *sensor_doubts(dataset))
    if registration is None:
        return doubts
    robot = registration.repaired.phantom_from_robot
    if registration.camera is None:
        return (*doubts, *force_doubts(dataset, robot))
    seen = seen_tools(dataset, registration)
    places, elsewhere = camera_doubts(seen)
    doubts += (*places, *rest_doubts(dataset, registration))
    if elsewhere:  # where the tool is elsewhere, its forces and its frame cannot be judged
        return doubts
    return (*doubts, *tool_frame_doubts(dataset, registration, seen), *force_doubts(dataset, robot))
