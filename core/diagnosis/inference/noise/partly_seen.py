"""Patches of which a group sees a small part: what is left at the rim of a hole or of a shadow.

The few points that a patch has there lie at its margin, and next to pixels without a reading or
with another surface's. Their average is off from that of the whole patch by more than their number
tells.
"""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray
from palpate.measurement.patch_averages import MaskArray

__all__ = ["partly_seen"]


def partly_seen(count: FloatArray) -> MaskArray:
    """Return which averages (g, p) come from a small part of their patch.

    These are the ones where a patch's share of its group's points is less than
    `CRITERIA.noise.seen_share` of its largest share in any group.

    Args:
        count: points of each average (g, p).
    """
    share = count / np.maximum(count.sum(axis=1, keepdims=True), 1)
    return np.asarray((count > 0) & (share < CRITERIA.noise.seen_share * share.max(axis=0)))
