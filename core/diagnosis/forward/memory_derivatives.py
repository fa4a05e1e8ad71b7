"""First-order stress changes by a material with history, from the plain replay alone.

To first order in the share g that relaxes (see `palpate.replay.material_history`), the block at a
group lacks g Z of its stress, with Z' = (S - Z) / tau and S the elastic shear stress: the loading
history as seen through a window of tau. With permanent set it lacks the stress T of the strain that
remains. Either is a load on the frame, and one linear solve. S and the strain between the groups
are those of `palpate.diagnosis.forward.loading_history`. After the tool has left, nothing holds the
block, and Z decays with the retardation time tau / (1 - g).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from palpate.diagnosis.forward.loading_history import LoadingHistory
from palpate.fem.constitutive.elastic import Law
from palpate.fem.history.history_stress import constant_stress_force, shear_stress
from palpate.fem.history.material_points import material_points
from palpate.fem.model import BlockModel
from palpate.fem.strain_tensors import cauchy_green, from_log_strain, log_strain
from palpate.foundation.arrays import FloatArray
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Relaxation, Setup

__all__ = ["StressHistory"]


class StressHistory:
    """Stress that the groups of one sequence lose by a material with history.

    Args:
        block: of the plain replay.
        frames: its equilibria, one for each group.
        time: loading history between the groups.

    Attributes:
        order: numbers of the groups by time.
    """

    def __init__(self, block: Replay, frames: Sequence[Equilibrium], time: LoadingHistory) -> None:
        self._law, self._time = Law.of(block.setup.material), time
        self.order: list[int] = np.argsort(time.instants, kind="stable").tolist()
        self._points = material_points(block.setup, block.grid, block.free.mesh)
        own = [frames[number] for number in time.touched]
        self._strained = [
            cauchy_green(self._points.tangents(frame.mesh, frame.mesh.nodes + frame.displacement))
            for frame in own
        ]

    def stress_losses(self, changed: Setup) -> Iterator[FloatArray | None]:
        """Yield for each group, in order of time, the stress that its material points lose.

        It is (m, 6), over the shear modulus; None where nothing is lost. One group at a time: the
        stresses of all groups and effects would fill half a gigabyte.

        Args:
            changed: the setup with a material that has history.
        """
        material = changed.material
        parts = [self._relaxed(term) for term in material.relaxation]
        if material.retained_fraction:
            parts.append(self._set(material.retained_fraction))
        for _ in self.order:
            yield _sum([next(part) for part in parts])

    def load(self, model: BlockModel, stress: FloatArray, displacement: FloatArray) -> FloatArray:
        """Return the load on the unknowns over E (u,) [m^2] that stands for a loss of stress.

        Args:
            model: factorised at the frame.
            stress: that is lost (m, 6), over the shear modulus.
            displacement: of the nodes (n, 3) [m].
        """
        at_points = self._points.read(model.mesh, stress) * model.unrelaxed[..., None]
        return constant_stress_force(model, at_points, displacement)

    @cached_property
    def _stresses(self) -> list[FloatArray]:
        return [shear_stress(self._law, strained) for strained in self._strained]

    def _relaxed(self, term: Relaxation) -> Iterator[FloatArray | None]:
        rates = np.where(self._time.depths > 0, 1.0, 1.0 - term.fraction) / term.time_constant
        left = term.fraction * self._time.faded(rates)
        return (self._mixed(left[number], self._stresses) for number in self.order)

    def _mixed(self, shares: FloatArray, fields: Sequence[FloatArray]) -> FloatArray | None:
        """Return the weighted sum of fields; None for no weight.

        It is added up in place, as a list of the parts would need many times the memory.
        """
        total = None
        for share, field in zip(shares.tolist(), fields, strict=True):
            if abs(share) > 1e-6:
                total = share * field if total is None else np.add(total, share * field, out=total)
        return total

    @cached_property
    def _strains(self) -> list[FloatArray]:
        return [log_strain(strained) for strained in self._strained]

    def _set(self, retained_fraction: float) -> Iterator[FloatArray | None]:
        """Yield the stress of the remaining strain.

        Strain is stored along the path as in `palpate.replay.material_history`, from one peak to
        the next.
        """
        kept: FloatArray = np.zeros((0, 6))
        largest, peaks, at = np.zeros(0), self._time.peaks(), 0
        for number in self.order:
            instant = self._time.instants[number]
            while np.isfinite(instant) and at < len(peaks) and peaks[at][0] <= instant:
                strain = self._mixed(peaks[at][1], self._strains)
                at += 1
                if strain is None:
                    continue
                if not len(kept):
                    largest, kept = np.zeros(len(strain)), np.zeros_like(strain)
                size = np.sqrt(np.einsum("mc,mc,c->m", strain, strain, [1, 1, 1, 2, 2, 2]))
                growing = size > largest
                kept[growing] += ((size - largest)[growing] / size[growing])[:, None] * strain[
                    growing
                ]
                largest = np.maximum(size, largest)
            known = np.isfinite(instant) and len(kept)
            yield (
                shear_stress(self._law, from_log_strain(retained_fraction * kept))
                if known
                else None
            )


def _sum(stresses: Sequence[FloatArray | None]) -> FloatArray | None:
    """Return the sum of those that are there; None without any."""
    known = [stress for stress in stresses if stress is not None]
    return np.asarray(sum(known[1:], start=known[0])) if known else None
