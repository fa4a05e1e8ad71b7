"""What a material that remembers would do, to first order, by the plain replay alone: no step of
its past is replayed.

To first order in the share g that relaxes (see `palpate.replay.material_history`), the block at a
group lacks g Z of its stress, Z' = (S - Z) / tau, S the elastic shear stress: what it has lived
through, seen through a window of tau. Of permanent set it lacks the stress T of the strain that
stays. Either is a load on the frame as it is, and one linear solve. S and strain between the groups
are those of `palpate.diagnosis.forward.loading_history`. Once the tool has left, nothing holds the
block, and Z fades with the retardation time tau / (1 - g).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from palpate.diagnosis.forward.loading_history import LoadingHistory
from palpate.fem.constitutive.elastic import Law
from palpate.fem.history_stress import ConstantStress, shear_stress
from palpate.fem.material_points import material_points
from palpate.fem.model import BlockModel
from palpate.fem.strain_tensors import cauchy_green, from_log_strain, log_strain
from palpate.foundation.arrays import FloatArray
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Relaxation, Setup

__all__ = ["Recollection"]


class Recollection:
    """What one sequence's groups lack of their stress when the material remembers.

    Args:
        block: the plain replay's.
        frames: its equilibria, one for each group.
        time: what lies between them.

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
        """On the unknowns of a model over E (u,) [m^2], as it stands displaced (n, 3) [m], where
        its stress lacks this (m, 6).
        """
        at_points = self._points.read(model.mesh, stress) * model.unrelaxed[..., None]
        return ConstantStress.of(model, at_points).force(displacement[model.topology.free])

    @cached_property
    def _stresses(self) -> list[FloatArray]:
        return [shear_stress(self._law, strained) for strained in self._strained]

    def _relaxed(self, term: Relaxation) -> Iterator[FloatArray | None]:
        rates = (
            np.where(self._time.depths > 0, 1.0, 1.0 - term.fraction) / term.time_constant
        )
        left = term.fraction * self._time.faded(rates)
        return (self._mixed(left[number], self._stresses) for number in self.order)

    def _mixed(self, shares: FloatArray, fields: Sequence[FloatArray]) -> FloatArray | None:
        """Added up in place: a list of the parts would take many times as much memory."""
        total = None
        for share, field in zip(shares.tolist(), fields, strict=True):
            if abs(share) > 1e-6:
                total = share * field if total is None else np.add(total, share * field, out=total)
        return total

    @cached_property
    def _strains(self) -> list[FloatArray]:
        return [log_strain(strained) for strained in self._strained]

    def _set(self, retained_fraction: float) -> Iterator[FloatArray | None]:
        """Strain is kept along the way as `palpate.replay.material_history` keeps it, from one peak
        to the next.
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
