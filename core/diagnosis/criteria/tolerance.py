"""How large an error must be to matter."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.diagnosis.criteria.criteria import CRITERIA

__all__ = ["Tolerance"]


@dataclass(frozen=True)
class Tolerance:
    """Size below which structured error is reported, and raises no verdict of unexplained.

    Attributes:
        stated: by the user [m]; None for the larger of a length and a share of the motion.
    """

    stated: float | None = None

    def of(self, motion: float) -> float:
        """The tolerance [m] where the visible surface moves by `motion` [m] RMS."""
        if self.stated is not None:
            return self.stated
        return max(CRITERIA.verdict.tolerance, CRITERIA.verdict.tolerance_share * motion)
