"""Internal variables of the virtual block's material: stress relaxation and permanent set.

Relaxation: a share of the shear modulus belongs to polymer chains that flow. Their natural metric A
follows the inverse of C, the isochoric right Cauchy-Green tensor, by A' = (C^-1 - A) / tau (Linder,
Tkachuk and Miehe 2011). At rest A = C^-1, and the chains carry no stress. In a motion faster than
tau, A is constant, and the chains are neo-Hookean. Over a step of length t in which C^-1 changes
linearly, A keeps e^(-t/tau) of itself and takes the rest from C^-1. The part that comes from the
end of the step carries no shear stress, so each step is an equilibrium in a metric known before.

With its second law the material relaxes by two such terms, with shares of a half each.

Permanent set: the natural metric is exp(-2 f M). M is the logarithmic strain at the largest strain
that a point has had. With its second law M follows the logarithmic strain with a time constant,
where this strain is large and does not fall. The M of a step is found by repeating its equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.rest_metric import isochoric
from palpate.synthetic.solver.tet_block import TetBlock

__all__ = ["InelasticHistory", "InelasticState", "relaxed_share"]


def relaxed_share(scenario: Scenario) -> float:
    """Share of the shear modulus that relaxes [1]."""
    hidden = scenario.hidden("viscoelasticity")
    return hidden.value("relaxed_fraction") if hidden else 0.0


_SPREAD = 3.0
"""Factor between the time constants of two terms and the stated one [1]."""
_YIELD, _FALLING, _FLOW_TIME = 0.03, 0.995, 1.0
"""Second law of permanent set: strain above which the material flows [1], share of the strain
before below which it counts as falling [1], and time constant of the flow [s]."""


@dataclass(frozen=True, eq=False)
class InelasticState:
    """Internal variables at the block's volume points.

    Attributes:
        time: [s]; None after a long rest.
        chains: (m, e, q, 3, 3) natural metric A of the chains of each term.
        inverse: (e, q, 3, 3) C^-1.
        largest: (e, q) largest norm of the logarithmic strain so far; the last one with the second
            law of permanent set.
        peak_strain: (e, q, 3, 3) M.
        natural: (e, q, 3, 3) exp(-2 f M).
    """

    time: float | None
    chains: FloatArray
    inverse: FloatArray
    largest: FloatArray
    peak_strain: FloatArray
    natural: FloatArray


class InelasticHistory:
    """The material history of one block.

    Attributes:
        inelastic_state: after the last step.
        time_constants: of the terms of the relaxation [s]; one, infinite, without.
        fraction: of the peak strain that stays [1].
    """

    def __init__(self, scenario: Scenario, block: TetBlock) -> None:
        relaxation, permanent = (
            scenario.hidden(name) for name in ("viscoelasticity", "permanent_set")
        )
        self._block = block
        self._share = relaxed_share(scenario)
        stated = relaxation.value("time_constant") if relaxation else np.inf
        self.time_constants: tuple[float, ...] = (stated,)
        if relaxation is not None and relaxation.second_law:
            self.time_constants = (stated / _SPREAD, stated * _SPREAD)
        self.fraction = permanent.value("retained_fraction") if permanent else 0.0
        self._flows = permanent is not None and permanent.second_law
        points = block.weights.shape
        same = np.broadcast_to(np.eye(3), (*points, 3, 3)).copy()
        self.inelastic_state = InelasticState(
            None, self._each(same), same, np.zeros(points), np.zeros((*points, 3, 3)), same
        )

    @property
    def time_constant(self) -> float:
        """The shortest time constant of relaxation and flow [s]."""
        return min(self.time_constants[0], _FLOW_TIME) if self._flows else self.time_constants[0]

    def _each(self, metric: FloatArray) -> FloatArray:
        """The same metric (e, q, 3, 3) for each term (m, e, q, 3, 3)."""
        return np.broadcast_to(metric, (len(self.time_constants), *metric.shape))

    @property
    def relaxes(self) -> bool:
        """Whether the material changes while the tool stands still."""
        return self._share > 0 or self._flows

    @property
    def is_initial(self) -> bool:
        """Whether no step has been made yet."""
        return self.inelastic_state.time is None

    def settle(self, displacement: FloatArray) -> None:
        """Start from a block long at rest with displacement (n, 3) [m]; its sag leaves no set."""
        inverse = np.asarray(
            np.linalg.inv(isochoric(displacement, self._block.elements, self._block.gradients)),
            dtype=float,
        )
        self.inelastic_state = replace(
            self.inelastic_state, chains=self._each(inverse), inverse=inverse
        )

    def metric(self, time: float | None, natural: FloatArray | None = None) -> FloatArray:
        """Metric G (e, q, 3, 3) [1] of the equilibrium at a time [s], over the shear modulus.

        The base law carries the share 1 - g that does not relax.

        Args:
            time: [s]; None for a long rest.
            natural: the natural metric at the end of this step; that of the last step without it.
        """
        state, share = self.inelastic_state, self._share
        natural = state.natural if natural is None else natural
        metric = (1 - share) * (natural - np.eye(3))
        if share and time is not None:
            for chains, time_constant in zip(state.chains, self.time_constants, strict=True):
                left, taken = self._shares(time, time_constant)
                own = (
                    left * chains
                    + (taken - left) * state.inverse
                    + taken * (natural - state.natural)
                )
                metric = metric + share / len(self.time_constants) * own
        return np.asarray(metric)

    def _shares(self, time: float, time_constant: float) -> tuple[float, float]:
        """Share of the chains' metric that is left after the step [1], and share of a linear change
        of C^-1 that they have not followed [1].
        """
        span = (
            0.0
            if self.inelastic_state.time is None
            else (time - self.inelastic_state.time) / time_constant
        )
        return float(np.exp(-span)), float(-np.expm1(-span) / span) if span > 0 else 1.0

    def after(self, displacement: FloatArray, time: float | None) -> InelasticState:
        """Internal variables after an equilibrium with displacement (n, 3) [m] at a time [s]."""
        state = self.inelastic_state
        c = isochoric(displacement, self._block.elements, self._block.gradients)
        inverse = np.asarray(np.linalg.inv(c), dtype=float)
        largest, peak_strain, natural = self._flow(c, time) if self._flows else self._set(c)
        chains = state.chains
        if self._share and time is not None:
            chains = np.stack(
                [
                    self._followed(own, inverse, natural, self._shares(time, time_constant))
                    for own, time_constant in zip(chains, self.time_constants, strict=True)
                ]
            )
        return InelasticState(time, chains, inverse, largest, peak_strain, natural)

    def _followed(
        self,
        chains: FloatArray,
        inverse: FloatArray,
        natural: FloatArray,
        shares: tuple[float, float],
    ) -> FloatArray:
        """The natural metric (e, q, 3, 3) of a term's chains after a step."""
        state, (left, taken) = self.inelastic_state, shares
        followed = (
            left * chains + (1 - left) * state.inverse + (1 - taken) * (inverse - state.inverse)
        )
        return np.asarray(followed + taken * (natural - state.natural))

    def _flow(self, c: FloatArray, time: float | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Size of the strain, M and natural metric after a step, by the second law."""
        state = self.inelastic_state
        values, axes = np.linalg.eigh(c)
        logarithms = 0.5 * np.log(values)
        size = np.linalg.norm(logarithms, axis=-1)
        spent = 0.0 if time is None or state.time is None else time - state.time
        flows = (size > _YIELD) & (size >= _FALLING * state.largest)
        strain = _along(axes[flows], logarithms[flows])
        peak_strain, natural = state.peak_strain.copy(), state.natural.copy()
        peak_strain[flows] += -np.expm1(-spent / _FLOW_TIME) * (strain - peak_strain[flows])
        values, axes = np.linalg.eigh(peak_strain[flows])
        natural[flows] = _along(axes, np.exp(-2 * self.fraction * values))
        return size, peak_strain, natural

    def _set(self, c: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        state = self.inelastic_state
        if not self.fraction:
            return state.largest, state.peak_strain, state.natural
        values, axes = np.linalg.eigh(c)
        logarithms = 0.5 * np.log(values)
        size = np.linalg.norm(logarithms, axis=-1)
        further = size > state.largest
        strain = _along(axes[further], logarithms[further])
        peak_strain, natural = state.peak_strain.copy(), state.natural.copy()
        peak_strain[further] += ((size - state.largest)[further] / size[further])[
            :, None, None
        ] * strain
        values, axes = np.linalg.eigh(peak_strain[further])
        natural[further] = _along(axes, np.exp(-2 * self.fraction * values))
        return np.maximum(size, state.largest), peak_strain, natural


def _along(axes: FloatArray, values: FloatArray) -> FloatArray:
    """Symmetric tensors (m, 3, 3) from their eigenvectors, in columns, and eigenvalues (m, 3)."""
    return np.asarray((axes * values[:, None, :]) @ np.swapaxes(axes, 1, 2))
