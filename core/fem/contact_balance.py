"""Balance of the contact on a few nodes with the body condensed on them."""

from __future__ import annotations

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cho_factor, cho_solve

from palpate.fem.contact_patch import ContactPatch
from palpate.fem.model import BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray

__all__ = ["ContactBalance"]

_MOST_STEPS, _TOLERANCE = 60, 1e-8
"""Steps of a balance, and the longest motion of its last step [m]."""
_SHRINKING = 0.25
"""A factor is kept while each step is shorter than this share of the one before [1]."""


class ContactBalance:
    """Contact, and the linear body that it presses.

    Args:
        patch: sides that may touch.
        stiffness: (m, m) of the body over E, condensed on their nodes [m].
    """

    def __init__(self, patch: ContactPatch, stiffness: FloatArray) -> None:
        self._patch, self._stiffness = patch, stiffness
        self._factor: tuple[FloatArray, bool] | None = None

    def change(
        self, model: BlockModel, here: FloatArray, tool: ToolSphere, load: FloatArray
    ) -> FloatArray | None:
        """The change (m,) that minimises the energy of body and contact [m]; None if Newton's
        method with a line search does not find it.

        The factor of the last balance is used as long as the steps shrink fast (modified Newton).

        Args:
            model: the body.
            here: (k, 3) of the nodes before the change [m].
            tool: the tool.
            load: (m,) over E [m^2].
        """
        change, pulled = np.zeros(len(load)), np.zeros(len(load))
        energy, longest = self._patch.energy(model, here, tool), np.inf
        for _ in range(_MOST_STEPS):
            place = here + change.reshape(-1, 3)
            slope, move = self._move(model, place, tool, load + pulled, longest)
            stretched = self._stiffness @ move
            length = 1.0
            while length > 1e-3:
                trial = change + length * move
                value = self._patch.energy(model, here + trial.reshape(-1, 3), tool) + float(
                    (0.5 * (pulled + length * stretched) + load) @ trial
                )
                if value <= energy + 1e-4 * length * float(slope @ move) + model.rounding:
                    break
                length /= 2
            change, pulled, energy = trial, pulled + length * stretched, value
            longest = float(np.abs(move).max()) if length == 1.0 else 0.0
            if float(np.abs(move).max()) < _TOLERANCE:
                return change
        return None

    def _move(
        self,
        model: BlockModel,
        place: FloatArray,
        tool: ToolSphere,
        load: FloatArray,
        longest: float,
    ) -> tuple[FloatArray, FloatArray]:
        """Gradient of the energy (m,) and a step (m,): that of the stored factor, if it is short
        enough beside the longest motion of the step before [m], or Newton's.

        The contact's curvature is left out if the tangent with it is not positive.
        """
        if self._factor is not None:
            slope = load + self._patch.contact(model, place, tool, tangent=False)[0]
            move = -cho_solve(self._factor, slope, check_finite=False)
            if float(np.abs(move).max()) < _SHRINKING * longest:
                return slope, np.asarray(move)
        force, tangent = self._patch.contact(model, place, tool)
        slope = load + force
        tangent += self._stiffness
        try:
            # In column order, which its symmetry allows, it is factorised in place.
            self._factor = cho_factor(tangent.T, overwrite_a=True, check_finite=False)
            return slope, np.asarray(-cho_solve(self._factor, slope, check_finite=False))
        except LinAlgError:
            self._factor = None
            tangent = self._patch.contact(model, place, tool, bending=False)[1]
            return slope, np.asarray(-np.linalg.solve(self._stiffness + tangent, slope))
