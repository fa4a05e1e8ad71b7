"""The catalogue of effects as columns of one linear problem."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.effect_derivative import prior_deviation
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import InferenceProblem
from palpate.diagnosis.search.inclusion_grid import screened_inclusions
from palpate.diagnosis.search.screening import Candidate
from palpate.diagnosis.search.signatures import Signature
from palpate.effects import Effect, Linearisation, NuisanceBlock, Tangent
from palpate.setup.setup import Setup

__all__ = ["candidates_of", "local_candidate", "mesh_candidates", "tangents_of"]


def tangents_of(
    kinds: Sequence[type[Effect]], setup: Setup, besides: Sequence[str] = ()
) -> tuple[Tangent, ...]:
    """Return the tangents of the effects that are linearised by derivatives.

    They replace replays at a finite size for a thirtieth of the time.

    Args:
        kinds: effects to choose from.
        setup: in which the effects are absent.
        besides: names of effects that are left out.
    """
    return tuple(
        tangent
        for kind in kinds
        if kind.linearisation is Linearisation.TANGENT and kind.name not in besides
        for tangent in kind.tangents(setup)
    )


def candidates_of(
    model: Model, evaluator: Evaluator, signatures: Sequence[Signature]
) -> list[Candidate]:
    """Return every applicable effect that is not in the model yet, as columns of it.

    Args:
        model: with columns of tangents, inclusions and signatures.
        evaluator: of the inference problem.
        signatures: of the effects that are screened at a finite size.
    """
    problem = evaluator.problem
    found = [
        candidate
        for block in NuisanceBlock
        if block is not NuisanceBlock.MESH_ERROR
        for candidate in _nuisance_candidates(problem, model, block)
    ]
    found += _tangent_candidates(model)
    found += _inclusion_candidates(problem, model)
    for column, (effect, predictions) in zip(model.layout.signatures, signatures, strict=True):
        if any(
            np.isfinite(p.gap).any() or (p.forces is not None and np.isfinite(p.forces.gap).any())
            for p in predictions
        ):
            found.append(Candidate(start=effect, columns=(column,), spread=(1.0,)))
    if not evaluator.state.on_diagnosis_grid:
        found += mesh_candidates(problem, model)
    return [candidate for candidate in found if candidate.start.name not in model.names]


def _nuisance_candidates(
    problem: InferenceProblem, model: Model, block: NuisanceBlock
) -> list[Candidate]:
    """Return the effects that share a block of nuisances, whose prior they widen."""
    columns = [model.nuisance[place] for place in problem.blocks.places(block)]
    found = []
    for kind in problem.applicable:
        if kind.nuisance is block:
            steps = CRITERIA.priors.parameter_steps
            spreads = [steps * item.scale for item in kind.numbers()]
            names = tuple(item.name for item in kind.numbers())
            widened = dict(zip(columns, spreads, strict=True))
            found.append(Candidate(start=kind.neutral(model.setup), of=names, widened=widened))
    return found


def mesh_candidates(problem: InferenceProblem, model: Model) -> list[Candidate]:
    """Return the effects that share the mesh error, whose prior they widen.

    A replay on the finer grid is no option for a refit, which has no finer grid.
    """
    widened = {model.nuisance[-1]: CRITERIA.priors.mesh_multiple}
    return [
        Candidate(start=kind.neutral(model.setup), widened=widened, refitted=False)
        for kind in problem.applicable
        if kind.nuisance is NuisanceBlock.MESH_ERROR
    ]


def _tangent_candidates(model: Model) -> list[Candidate]:
    """Return one candidate for each tangent, and one for all those of a joint effect."""
    groups: list[list[tuple[int, Tangent]]] = []
    for row in zip(model.layout.tangents, model.tangents, strict=True):
        effect = row[1].effect
        if effect.joint and groups and groups[-1][0][1].effect == effect:
            groups[-1].append(row)
        else:
            groups.append([row])
    return [
        Candidate(
            start=rows[0][1].effect,
            of=tuple(tangent.of for _, tangent in rows if tangent.of),
            columns=tuple(column for column, _ in rows),
            spread=tuple(prior_deviation(tangent) for _, tangent in rows),
        )
        for rows in groups
    ]


def local_candidate(effect: Effect, column: int) -> Candidate:
    """Return a neutral effect that is linearised by local stiffness, with its column."""
    tangent = Tangent(effect=effect, of=effect.amplitude, deviation=effect.amplitude_deviation)
    return Candidate(
        start=effect, of=(tangent.of,), columns=(column,), spread=(prior_deviation(tangent),)
    )


def _inclusion_candidates(problem: InferenceProblem, model: Model) -> list[Candidate]:
    """Return the effects that are linearised by local stiffness, at each of their places."""
    return [
        local_candidate(effect, model.layout.inclusions[number])
        for effect, number in screened_inclusions(problem).effects
    ]
