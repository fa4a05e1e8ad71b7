"""What a material that remembers would do, to first order, by the plain replay alone: no step of its past is replayed.

To first order in the share g that relaxes (see `core.memory`), the block at a group lacks g Z of its stress, Z' = (S - Z) / tau, S
the elastic shear stress: what it has lived through, seen through a window of tau. Of permanent set it lacks the stress T of the
strain that stays. Either is a load on the frame as it is, and one linear solve. S and strain between the groups are those of
`core.diagnosis.timeline`. Once the tool has left, nothing holds the block, and Z fades with the retardation time tau / (1 - g).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.diagnosis.timeline import Timeline
from core.effects import Effect
from core.effects.memory import PermanentSet, Viscoelasticity
from core.fem.elastic import Law
from core.fem.memory import ConstantStress, cauchy_green, from_log_strain, log_strain, shear_stress
from core.fem.model import BlockModel
from core.fem.points import material_points
from core.frames import FloatArray
from core.replay import Equilibrium, Replay

__all__ = ["Recollection"]


class Recollection:
    """What one sequence's groups lack of their stress when the material remembers.

    Args:
        block: the plain replay's. frames: its equilibria, one for each group. time: what lies between them.
    """

    def __init__(self, block: Replay, frames: Sequence[Equilibrium], time: Timeline) -> None:
        self._law, self._time, self._count = Law.of(block.setup.material), time, len(frames)
        self._points = material_points(block.setup, block.grid, block.free.mesh)
        own = [frames[number] for number in time.touched]
        self._strained = [cauchy_green(self._points.tangents(frame.mesh, frame.mesh.nodes + frame.displacement)) for frame in own]

    def lacks(self, effect: Effect) -> list[FloatArray | None]:
        """For each group the stress (m, 6) over the shear modulus that it takes from the material's points; None of none."""
        if isinstance(effect, Viscoelasticity):
            return self._relaxed(effect)
        if isinstance(effect, PermanentSet):
            return self._set(effect)
        raise TypeError(f"{effect.name} is nothing that a material remembers")

    def load(self, model: BlockModel, stress: FloatArray, displacement: FloatArray) -> FloatArray:
        """On the unknowns of a model over E (u,) [m^2], as it stands displaced (n, 3) [m], where its stress lacks this (m, 6)."""
        at_points = self._points.read(model.mesh, stress) * model.unrelaxed[..., None]
        return ConstantStress.of(model, at_points).force(displacement[model.topology.free])

    def _relaxed(self, effect: Viscoelasticity) -> list[FloatArray | None]:
        stresses = [shear_stress(self._law, strained) for strained in self._strained]
        rates = np.where(self._time.depths > 0, 1.0, 1.0 - effect.relaxed_fraction) / effect.time_constant
        left = effect.relaxed_fraction * self._time.faded(rates)
        return [self._mixed(row, stresses) for row in left]

    def _mixed(self, shares: FloatArray, fields: Sequence[FloatArray]) -> FloatArray | None:
        parts = [share * field for share, field in zip(shares.tolist(), fields, strict=True) if abs(share) > 1e-6]
        return np.sum(parts, axis=0) if parts else None

    def _set(self, effect: PermanentSet) -> list[FloatArray | None]:
        """Strain is kept along the way as `core.memory` keeps it, from one peak to the next."""
        strains = [log_strain(strained) for strained in self._strained]
        found: list[FloatArray | None] = [None] * self._count
        if not strains:
            return found
        largest, kept = np.zeros(len(strains[0])), np.zeros_like(strains[0])
        peaks = self._time.peaks()
        at = 0
        for number in np.argsort(self._time.instants):
            instant = self._time.instants[number]
            if not np.isfinite(instant):
                continue
            while at < len(peaks) and peaks[at][0] <= instant:
                strain = self._mixed(peaks[at][1], strains)
                at += 1
                if strain is None:
                    continue
                size = np.sqrt(np.einsum("mc,mc,c->m", strain, strain, [1, 1, 1, 2, 2, 2]))
                growing = size > largest
                kept[growing] += ((size - largest)[growing] / size[growing])[:, None] * strain[growing]
                largest = np.maximum(size, largest)
            if at:
                found[number] = shear_stress(self._law, from_log_strain(effect.retained_fraction * kept))
        return found
