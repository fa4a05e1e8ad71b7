"""An all-clear must hold on the sequences that nothing was fitted on, too (step 10 of the method).

What is wrong in one kind of push or at one place need not show in the sequences that causes are
sought in. A cause is never chosen by what the others show; that nothing is wrong is not said
against them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.residual_structure import Structure, structure_of
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.candidates import lump_places
from palpate.diagnosis.validation.stiffness_error_test import (
    StiffnessErrorTest,
    largest_stiffness_error,
)

__all__ = ["HeldOutCheck", "check_held_out"]


@dataclass(frozen=True, eq=False)
class HeldOutCheck:
    """The stated setup on sequences that nothing was fitted on, the structured error it leaves
    there, and what they ask for.
    """

    model: Model
    structure: Structure
    asked: StiffnessErrorTest | None = None


def check_held_out(
    bench: Bench, held_out: Sequence[Observations], seed: int
) -> HeldOutCheck | None:
    """Of those with clouds; None where there are none. The workers of the bench must have them."""
    names = [item.name for item in held_out if not item.force_only]
    if not names:
        return None
    stated, forces = (bench.setup, bench.registration, bench.workers), bench.nuisances.forces
    other = Bench(*stated, names, bench.static, bench.grid, bench.fine, forces=forces)
    model = other.baseline((), lump_places(other))
    return HeldOutCheck(
        model, structure_of(other, model, seed), largest_stiffness_error(other, model)
    )
