"""What a search for causes found: every set of causes that was fitted, the one that is accepted,
and what it was weighed by.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.camera_error_model import CALM, Ripple
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.residual_structure import NOTHING, Structure
from palpate.diagnosis.search.identifiability import Told
from palpate.diagnosis.validation.held_out_test import HeldOutCheck
from palpate.diagnosis.validation.stiffness_error_test import StiffnessErrorTest
from palpate.effects import Effect

__all__ = ["Findings", "Trial"]


@dataclass(frozen=True, eq=False)
class Trial:
    """A refitted model and its gain over the baseline [nats], with the misfit per value it leaves.

    `parts` says where the gain comes from, once all trials are scored at one temperature: each
    block of data, and last the stated accuracies. `asked` is the gain that so many causes must
    bring [nats] before they are named; infinite for what was refused although it brings it.
    """

    model: Model
    gain: float
    misfit: float
    parts: tuple[float, ...] = ()
    asked: float = 0.0

    def scored(self) -> Trial:
        """Without the replays, which nobody asks for of a model that was not accepted: they take
        most of the memory.
        """
        return replace(self, model=replace(self.model, predictions=()))


@dataclass(eq=False)
class Findings:
    """What the search found.

    Attributes:
        baseline: the stated setup.
        best: the model accepted, or None.
        trials: every refitted model, best first.
        bound: least gain of a cause [nats].
        misfit: of the baseline, per value.
        screened: linear gain by effect name.
        structure: error of the baseline that is smooth and grows with the push.
        left: the same of the best model.
        told: what this experiment tells of each effect, whatever the data say.
        ripple: of the camera's depth in the rest cloud, which no effect expresses.
        asked: how much of the engine's own error some sequence asks for; only looked at before an
            all-clear.
        beyond: what the stated setup leaves on sequences that nothing was fitted on; likewise.
        withdrawn: why what was found is not named after all; empty where nothing was withdrawn.
        known: what no replay could do without: touches that were surely of other landmarks.
    """

    baseline: Model
    best: Trial | None = None
    trials: list[Trial] = field(default_factory=list)
    bound: float = CRITERIA.naming.least_gain
    misfit: float = 1.0
    screened: dict[str, float] = field(default_factory=dict)
    structure: Structure = NOTHING
    left: Structure = NOTHING
    told: tuple[Told, ...] = ()
    ripple: Ripple = CALM
    asked: StiffnessErrorTest | None = None
    beyond: HeldOutCheck | None = None
    withdrawn: str = ""
    known: tuple[Effect, ...] = ()

    def withdraw(self, why: str) -> None:
        """Name nothing after all, neither alone nor with a further cause."""
        names = set(self.best.model.names if self.best else ())
        self.trials = [
            trial for trial in self.trials if not names or not names.issubset(trial.model.names)
        ]
        self.best, self.left, self.withdrawn = None, self.structure, why

    @property
    def structured(self) -> bool:
        """Whether the stated setup leaves an error that noise does not make."""
        return (
            self.structure.significant
            or self.ripple.significant
            or self.missed
            or self.unusual is not None
        )

    @property
    def missed(self) -> bool:
        """Whether it leaves one where nothing was fitted."""
        return self.beyond is not None and self.beyond.structure.significant

    @property
    def looked_at(self) -> tuple[StiffnessErrorTest, ...]:
        """What sequences ask for, of those fitted first; nothing where no all-clear was in
        question.
        """
        both = (self.asked, self.beyond.asked if self.beyond else None)
        return tuple(one for one in both if one is not None)

    @property
    def unusual(self) -> StiffnessErrorTest | None:
        """The first that the engine's own error does not explain."""
        return next((one for one in self.looked_at if one.significant), None)

    def rivals(self) -> list[Trial]:
        """Other sets of as many causes that explain the data about as well as the best."""
        if self.best is None:
            return []
        best = self.best
        named = {best.model.names}
        close = []
        for trial in self.trials:
            names = trial.model.names
            if (
                len(names) == len(best.model.names)
                and names not in named
                and best.gain - trial.gain < CRITERIA.naming.rival
            ):
                named.add(names)
                close.append(trial)
        return close
