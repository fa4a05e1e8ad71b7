"""Evaluators of small inference problems, whose screening mesh is that of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.inference_problem import InferenceProblem
from palpate.diagnosis.inference.noise.rest_evidence import RestEvidence
from palpate.effects import CATALOGUE, Effect
from palpate.mesh.protocol import Meshing
from palpate.registration.registration import Registration
from palpate.setup.setup import Setup

__all__ = ["evaluator_of"]


def evaluator_of(
    setup: Setup,
    registration: Registration,
    workers: Workers,
    names: Sequence[str],
    at_rest: RestEvidence | None,
    grid: Meshing,
    fine: Meshing,
    *,
    forces: bool = False,
    catalogue: Sequence[type[Effect]] = CATALOGUE,
) -> Evaluator:
    """Make an evaluator of sequences with clouds."""
    problem = InferenceProblem(
        setup=setup,
        registration=registration,
        names=tuple(names),
        at_rest=at_rest,
        grid=grid,
        fine_grid=fine,
        coarse_grid=grid,
        forces=forces,
        catalogue=catalogue,
    )
    return Evaluator(problem, workers)
