"""What the virtual block remembers of its past: shear stress that relaxes, and strain that stays.

Relaxation: a share of the shear modulus belongs to chains that flow. Their natural metric A follows
the inverse of C, the right Cauchy-Green tensor without its part in the volume, A' = (C^-1 - A) /
tau (Linder, Tkachuk and Miehe 2011): at rest A = C^-1 they are without stress, and in a motion
faster than tau A stays, so that they are neo-Hookean. Over a step of length t in which C^-1 changes
evenly, A takes e^(-t/tau) of itself and the rest of C^-1; what it takes of the step's own end has
no shear stress, and so each step is an equilibrium in a metric that is known before.

Permanent set: the natural metric is exp(-2 f M). M is the logarithmic strain where a point was
strained most; while it is strained further, M goes with it. A step's own M is found by repeating
its equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.rest_metric import isochoric
from palpate.synthetic.solver.tet_block import Block

__all__ = ["Past", "Remembering", "relaxed_share"]


def relaxed_share(scenario: Scenario) -> float:
    """Share of the shear modulus that relaxes [1]."""
    hidden = scenario.hidden("viscoelasticity")
    return hidden.value("relaxed_fraction") if hidden else 0.0


@dataclass(frozen=True, eq=False)
class Past:
    """What is remembered at an instant [s], at the block's volume points; None for the time of a
    long rest.

    Attributes:
        chains: A (e, q, 3, 3).
        inverse: C^-1 (e, q, 3, 3).
        largest: |log strain| (e, q).
        kept: M (e, q, 3, 3).
        natural: exp(-2 f M) (e, q, 3, 3).
    """

    time: float | None
    chains: FloatArray
    inverse: FloatArray
    largest: FloatArray
    kept: FloatArray
    natural: FloatArray


class Remembering:
    """The memory of one block: what metric each step has, and what is left after it.

    Attributes:
        past: after the last step.
    """

    def __init__(self, scenario: Scenario, block: Block) -> None:
        hidden, kept = scenario.hidden("viscoelasticity"), scenario.hidden("permanent_set")
        self._block = block
        self._share = relaxed_share(scenario)
        self.time_constant = hidden.value("time_constant") if hidden else np.inf
        self.fraction = kept.value("retained_fraction") if kept else 0.0
        points = block.weights.shape
        same = np.broadcast_to(np.eye(3), (*points, 3, 3)).copy()
        self.past = Past(None, same, same, np.zeros(points), np.zeros((*points, 3, 3)), same)

    @property
    def delays(self) -> bool:
        """Whether anything goes on while the tool stands still."""
        return self._share > 0

    @property
    def untouched(self) -> bool:
        """Whether nothing has been done to it yet."""
        return self.past.time is None

    def settle(self, displacement: FloatArray) -> None:
        """Begin from a block that has long been at rest like this (n, 3) [m]: its sag left
        nothing."""
        inverse = np.asarray(
            np.linalg.inv(isochoric(displacement, self._block.elements, self._block.gradients)),
            dtype=float,
        )
        self.past = replace(self.past, chains=inverse, inverse=inverse)

    def metric(self, time: float | None, natural: FloatArray | None = None) -> FloatArray:
        """G (e, q, 3, 3) of the equilibrium at a time [s] over the shear modulus, beside the law's
        unrelaxed share of 1 - g.

        `natural` is the metric that the equilibrium's own set leaves; that of the last step without
        it.
        """
        past, share = self.past, self._share
        natural = past.natural if natural is None else natural
        found = (1 - share) * (natural - np.eye(3))
        if share and time is not None:
            left, taken = self._shares(time)
            own = (
                left * past.chains
                + (taken - left) * past.inverse
                + taken * (natural - past.natural)
            )
            found = found + share * own
        return np.asarray(found)

    def _shares(self, time: float) -> tuple[float, float]:
        """What is left of the chains' metric over the step, and how much of an even change of C^-1
        they have not followed yet.
        """
        span = 0.0 if self.past.time is None else (time - self.past.time) / self.time_constant
        return float(np.exp(-span)), float(-np.expm1(-span) / span) if span > 0 else 1.0

    def after(self, displacement: FloatArray, time: float | None) -> Past:
        """What an equilibrium (n, 3) [m] leaves."""
        past = self.past
        c = isochoric(displacement, self._block.elements, self._block.gradients)
        inverse = np.asarray(np.linalg.inv(c), dtype=float)
        largest, kept, natural = self._set(c)
        chains = past.chains
        if self._share and time is not None:
            left, taken = self._shares(time)
            chains = (
                left * past.chains
                + (1 - left) * past.inverse
                + (1 - taken) * (inverse - past.inverse)
            )
            chains = chains + taken * (natural - past.natural)
        return Past(time, chains, inverse, largest, kept, natural)

    def _set(self, c: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        past = self.past
        if not self.fraction:
            return past.largest, past.kept, past.natural
        values, axes = np.linalg.eigh(c)
        logarithms = 0.5 * np.log(values)
        size = np.linalg.norm(logarithms, axis=-1)
        further = size > past.largest
        strain = _along(axes[further], logarithms[further])
        kept, natural = past.kept.copy(), past.natural.copy()
        kept[further] += ((size - past.largest)[further] / size[further])[:, None, None] * strain
        values, axes = np.linalg.eigh(kept[further])
        natural[further] = _along(axes, np.exp(-2 * self.fraction * values))
        return np.maximum(size, past.largest), kept, natural


def _along(axes: FloatArray, values: FloatArray) -> FloatArray:
    """Symmetric tensors (m, 3, 3) from their eigenvectors, in columns, and eigenvalues (m, 3)."""
    return np.asarray((axes * values[:, None, :]) @ np.swapaxes(axes, 1, 2))
