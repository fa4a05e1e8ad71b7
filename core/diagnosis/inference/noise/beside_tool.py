"""Patches beside the tool in depth that a filter has smoothed.

A filter that keeps edges still averages over the crease between the tool and the surface, where
depth has no step. The surface there seems some tenths of a millimetre too high while the tool is
near. That moves with the tool and grows with the push, like a deformation.
"""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.foundation.arrays import FloatArray
from palpate.measurement.patch_averages import MaskArray

__all__ = ["beside_tool", "width_of_smoothing"]


def width_of_smoothing(edge: float, shared: float) -> float:
    """Return the distance [m] from the tool up to which patches are left out; zero without filters.

    Args:
        edge: width of the band that the dataset's filters round [m]; zero where it states none.
        shared: variance that a patch's points share in a cloud, over that of single points [1]. It
            is above zero where a filter works that the dataset does not state.
    """
    return max(edge, CRITERIA.noise.smoothed if shared else 0.0)


def beside_tool(prediction: Prediction, centres: FloatArray, width: float) -> MaskArray:
    """Return which averages (g, p) are of patches within `width` [m] of the tool's sphere.

    The predicted places decide, and not the measured ones, so that the choice has no bias.

    Args:
        prediction: of the stated setup.
        centres: of the patches of the untouched surface (p, 3) [m].
        width: from `width_of_smoothing` [m].
    """
    found = np.zeros((len(prediction.equilibria), len(centres)), dtype=bool)
    if not width:
        return found
    for group, frame in enumerate(prediction.equilibria):
        away = np.linalg.norm(frame.move(centres) - frame.tool.centre, axis=1)
        found[group] = away < frame.tool.radius + width
    return found
