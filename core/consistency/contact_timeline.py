"""Contact of the tool with the phantom at rest over time, as the kinematics alone put it."""

from __future__ import annotations

from collections.abc import Sequence as Names
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Dataset, Sequence
from palpate.dataset.tool_motion import smooth_path
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["ContactTimeline", "named"]


@dataclass(frozen=True, eq=False)
class ContactTimeline:
    """Places of the tool in steps of some 50 ms.

    Attributes:
        time: (n,) [s].
        centre: (n, 3) [m], phantom frame.
        gap: (n,) [m] between tool and phantom at rest, negative where they overlap.
        normal: (n, 3) outward normals of the surface next to the tool, phantom frame.
    """

    time: FloatArray
    centre: FloatArray
    gap: FloatArray
    normal: FloatArray

    @classmethod
    def of(
        cls, dataset: Dataset, sequence: Sequence, phantom_from_robot: Transform
    ) -> ContactTimeline:
        """The timeline of a sequence under the stated shape, radius and a registration."""
        time, centre = smooth_path(sequence, phantom_from_robot)
        distance, normal = dataset.geometry.facing(centre)
        return cls(time, centre, distance - dataset.config.tool_radius, normal)

    @property
    def depth(self) -> FloatArray:
        """Overlap (n,) [m] of tool and phantom at rest; zero where they do not touch."""
        return np.maximum(-self.gap, 0.0)

    @property
    def push(self) -> FloatArray:
        """Vector (n, 3) [m^1.5] to which Hertz' force on the tool is proportional."""
        return np.asarray(self.depth[:, None] ** 1.5 * self.normal)


def named(names: Names[str], among: int) -> str:
    """Words for some of `among` sequences."""
    if len(names) == among and among > 1:
        return f"all {among} sequences"
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} more"
