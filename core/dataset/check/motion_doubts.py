"""Doubts about the place of the tool in a sequence, most often for a wrong unit."""

from __future__ import annotations

from dataclasses import replace

from palpate.dataset.folder import Dataset
from palpate.dataset.sequence import Sequence
from palpate.dataset.tool_motion import ToolMotion, describe_motion
from palpate.foundation.frames import Transform

__all__ = ["motion_doubts"]

DEEPEST = 0.6
"""Depth of the tool from which its place is in doubt, over the phantom's smallest extent [1]."""
_UNITS = {"decimetres": 0.1, "centimetres": 0.01, "millimetres": 0.001}
"""Units of length that are met in place of the metre [m]."""


def motion_doubts(
    dataset: Dataset, sequence: Sequence, motion: ToolMotion, phantom_from_robot: Transform
) -> list[str]:
    """Return a sentence where the tool never touches, or goes far into the phantom.

    Args:
        dataset: with the phantom.
        sequence: whose motion it is.
        motion: under the registration.
        phantom_from_robot: the registration.
    """
    if not motion.contacts:
        unit = _other_unit(dataset, sequence, phantom_from_robot)
        hint = (
            f"did you write {unit} in kinematics.csv? In that unit it touches"
            if unit
            else "are touches and tool radius right?"
        )
        return [
            f"the tool never touches the phantom, it stays {1e3 * motion.nearest:.1f} mm away: "
            f"{hint}"
        ]
    if -motion.nearest > DEEPEST * min(dataset.config.size):
        return [
            f"the tool goes {-1e3 * motion.nearest:.1f} mm into the phantom as stated: are "
            "touches, size and radius right?"
        ]
    return []


def _other_unit(dataset: Dataset, sequence: Sequence, phantom_from_robot: Transform) -> str | None:
    """The only other unit of the kinematics in which the tool touches the phantom."""
    found = []
    for unit, metres in _UNITS.items():
        path = replace(sequence.kinematics, position=metres * sequence.kinematics.position)
        moved = describe_motion(dataset, replace(sequence, kinematics=path), phantom_from_robot)
        if moved.contacts and -moved.nearest < DEEPEST * min(dataset.config.size):
            found.append(unit)
    return found[0] if len(found) == 1 else None
