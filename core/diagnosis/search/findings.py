"""Result of a search for causes: all sets that were fitted, and the one that is accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.camera_error_model import CALM, Ripple
from palpate.diagnosis.inference.noise.residual_structure import NOTHING, Structure
from palpate.diagnosis.search.chance_gains import ChanceGains
from palpate.diagnosis.search.identifiability import Identifiability
from palpate.effects import Effect
from palpate.effects.family import Family

__all__ = ["Findings", "Trial", "shared_family"]


def shared_family(one: Sequence[Effect], other: Sequence[Effect]) -> Family | None:
    """Return the family of the two effects in which two sets differ; None where they differ in
    more, or in effects of no common family.
    """
    names, others = {effect.name for effect in one}, {effect.name for effect in other}
    first = [effect.family for effect in one if effect.name not in others]
    second = [effect.family for effect in other if effect.name not in names]
    return first[0] if len(first) == len(second) == 1 and first == second else None


@dataclass(frozen=True, eq=False)
class Trial:
    """A refitted model with its scores.

    Attributes:
        model: as fitted.
        gain: over the baseline [nats].
        misfit: per value that it leaves.
        parts: of the gain, once all trials are scored at one temperature: of each block of data,
            and last of the stated accuracies.
        required_gain: gain from which so many causes are named [nats]; infinite for a model that
            was rejected although it has this gain.
    """

    model: Model
    gain: float
    misfit: float
    parts: tuple[float, ...] = ()
    required_gain: float = 0.0

    def scored(self) -> Trial:
        """Return the trial without its predictions, which take most of the memory."""
        return replace(self, model=replace(self.model, predictions=()))


@dataclass(eq=False)
class Findings:
    """Result of a search.

    Attributes:
        baseline: the stated setup.
        best: the model accepted, or None.
        trials: every refitted model, best first.
        bound: least gain of a cause on all data [nats].
        misfit: of the baseline, per value.
        screened: linear gain by effect name [nats].
        structure: error of the baseline that is smooth and grows with the push.
        remaining: the same error of the best model.
        identifiability: of each effect by this experiment, whatever the data are.
        ripple: of the camera's depth in the rest cloud, which no effect expresses.
        withdrawn: reason why the causes found are not named; empty for no reason.
        contradicted: whether the measured forces contradict the model that is left.
        known: effects without which nothing can be replayed: touches of other landmarks.
        hints: reason why an effect with enough gain is not named, by name.
        tolerance: size below which structured error does not matter.
        excess: RMS of the baseline's error beyond noise over the visible surface [m]; NaN without
            clouds.
        chance: gains of the catalogue in draws of this data's noise alone.
        bounds: least gain of an only cause on the fitted sequences, by effect name [nats]; `bound`
            for others.
        test_gain: gain of the best model on test sequences, with all numbers as fitted [nats]; None
            where it was not asked for.
    """

    baseline: Model
    best: Trial | None = None
    trials: list[Trial] = field(default_factory=list)
    bound: float = CRITERIA.naming.least_gain
    misfit: float = 1.0
    screened: dict[str, float] = field(default_factory=dict)
    structure: Structure = NOTHING
    remaining: Structure = NOTHING
    identifiability: tuple[Identifiability, ...] = ()
    ripple: Ripple = CALM
    withdrawn: str = ""
    contradicted: bool = False
    known: tuple[Effect, ...] = ()
    hints: dict[str, str] = field(default_factory=dict)
    tolerance: Tolerance = field(default_factory=Tolerance)
    excess: float = np.nan
    chance: ChanceGains = field(default_factory=ChanceGains)
    bounds: dict[str, float] = field(default_factory=dict)
    test_gain: float | None = None

    def bound_of(self, name: str) -> float:
        """Return the least gain of an effect as the only cause, on the fitted sequences [nats]."""
        return self.bounds.get(name, self.bound)

    def withdraw(self, why: str) -> None:
        """Reject the best model and all that extend it, for this reason."""
        names = set(self.best.model.names if self.best else ())
        self.trials = [
            trial for trial in self.trials if not names or not names.issubset(trial.model.names)
        ]
        self.hints |= dict.fromkeys(sorted(names), why)
        self.best, self.remaining, self.withdrawn = None, self.structure, why

    def contradict(self, why: str) -> None:
        """Name nothing, for this reason: the forces contradict every model."""
        self.withdraw(why)
        self.contradicted = True

    @property
    def faint(self) -> bool:
        """Whether causes were found by less than `bound`: test sequences must confirm them."""
        return self.best is not None and self.best.gain < self.bound

    @property
    def poor(self) -> bool:
        """Whether the stated setup leaves far more than noise, and enough to matter."""
        known_small = self.excess <= self.tolerance.of(self.structure.motion)
        return self.misfit > CRITERIA.verdict.unexplained_misfit and not known_small

    @property
    def structured(self) -> bool:
        """Whether the stated setup leaves an error on the fitted sequences that is no noise, and
        large enough to matter.
        """
        return self.structure.matters(self.tolerance) or self.ripple.significant

    def share_left(self, misfit: float) -> float:
        """Return the share of the stated model's misfit above noise that another one leaves [1]."""
        return min(max((misfit - 1.0) / max(self.misfit - 1.0, 1e-9), 0.0), 1.0)

    @property
    def doubtful(self) -> float:
        """Difference of gains [nats] up to which laws of one family are not told apart.

        Where the best model leaves significant structure its law is not the true one. It is then
        the gain that a model would have beyond the best one that removes what the best one leaves.
        """
        if self.best is None or not self.remaining.significant:
            return CRITERIA.naming.rival
        left = min(self.share_left(self.best.misfit), CRITERIA.naming.most_left)
        return max(CRITERIA.naming.rival, self.best.gain * left / (1.0 - left))

    def rivals(self) -> list[Trial]:
        """Return other sets of as many causes that explain the data about as well as the best, or
        less well by another law of the same family where the best law is wrong.
        """
        if self.best is None:
            return []
        best = self.best
        named = {best.model.names}
        close = []
        for trial in self.trials:
            names, behind = trial.model.names, best.gain - trial.gain
            if len(names) != len(best.model.names) or names in named:
                continue
            shared = shared_family(best.model.effects, trial.model.effects)
            if behind < (self.doubtful if shared else CRITERIA.naming.rival):
                named.add(names)
                close.append(trial)
        return close
