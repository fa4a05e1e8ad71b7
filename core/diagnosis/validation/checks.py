"""The checks of an all-clear, which is given only where nothing contradicts it."""

from __future__ import annotations

from dataclasses import dataclass, field

from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.validation.held_out_check import HeldOutCheck
from palpate.diagnosis.validation.stiffness_error_test import StiffnessErrorTest

__all__ = ["AllClearChecks"]


@dataclass(frozen=True, eq=False)
class AllClearChecks:
    """Checks that are made before an all-clear; empty where none was in question.

    Attributes:
        stiffness_error: largest error of local stiffness in a fitted sequence.
        held_out: the stated setup on sequences that nothing was fitted on.
        tolerance: size below which an error does not matter.
    """

    stiffness_error: StiffnessErrorTest | None = None
    held_out: HeldOutCheck | None = None
    tolerance: Tolerance = field(default_factory=Tolerance)

    @property
    def held_out_structure(self) -> bool:
        """Whether the stated setup leaves structure that matters where nothing was fitted."""
        return self.held_out is not None and self.held_out.structure.matters(self.tolerance)

    @property
    def stiffness_errors(self) -> tuple[StiffnessErrorTest, ...]:
        """Tests of local stiffness that were made, those of the fitted sequences first."""
        both = (self.stiffness_error, self.held_out.stiffness_error if self.held_out else None)
        return tuple(one for one in both if one is not None)

    @property
    def unusual(self) -> StiffnessErrorTest | None:
        """The first test that shows an error that the engine's own does not explain, and that
        matters.
        """
        return next((one for one in self.stiffness_errors if one.matters(self.tolerance)), None)

    @property
    def failed(self) -> bool:
        """Whether any check contradicts an all-clear."""
        return self.held_out_structure or self.unusual is not None
