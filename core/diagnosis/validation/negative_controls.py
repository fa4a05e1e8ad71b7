"""Negative controls of a named cause: with motions that were not made, it must lose its gain.

The residual of the stated model stays as measured, and so do weights, discrepancy and nuisances.
Only the cause's pattern, its change of each patch in each group, is replayed along falsified
motions (`palpate.diagnosis.validation.falsified_motions`). The gain of that pattern is computed
like that of the true one, by leaving sequences out. Comparing the clouds themselves with falsified
replays would not work: dents would be missing in one place and superfluous in another, and any
cause that makes dents shallower would gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction, predict
from palpate.diagnosis.forward.ray_comparison import PointSample
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import Noise, rows_of
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.identifiability import mimicry
from palpate.diagnosis.search.screening import Candidate, linear_gains, right_sides
from palpate.diagnosis.validation.falsified_motions import FALSIFIED
from palpate.effects import Effect
from palpate.effects.base import with_effects
from palpate.foundation.arrays import FloatArray
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup

__all__ = ["Control", "controls", "judge", "warnings_of"]


@dataclass(frozen=True, kw_only=True)
class Control:
    """One cause under one kind of falsified motions.

    Attributes:
        control: name of the kind.
        effect: name of the cause.
        gain: of the falsified pattern, on the falsified groups [nats].
        true: of the cause's own pattern, on the same groups [nats].
        alike: share of the cause's pattern that falsified motions imitate [1].
    """

    control: str
    effect: str
    gain: float
    true: float
    alike: float

    @property
    def passed(self) -> bool | None:
        """Whether the gain was lost; None if the control says nothing about this cause."""
        return (
            None
            if self.why
            else self.gain < max(CRITERIA.controls.retained * self.true, CRITERIA.controls.faint)
        )

    @property
    def why(self) -> str:
        """Reason why the control says nothing about this cause; empty if it does."""
        if self.alike > CRITERIA.controls.alike:
            return (
                f"with these motions {self.effect} would look {100 * self.alike:.0f} % "
                "as it does with the true ones"
            )
        return (
            f"{self.effect} gains too little on these frames to lose it"
            if self.true <= CRITERIA.controls.faint
            else ""
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values, as in the report."""
        retained = None if self.true <= CRITERIA.controls.faint else round(self.gain / self.true, 4)
        return {
            "control": self.control,
            "effect": self.effect,
            "gain_nats": round(self.gain, 2),
            "true_nats": round(self.true, 2),
            "kept": retained,
            "alike": round(self.alike, 4),
            "passed": self.passed,
            **({"why": self.why} if self.why else {}),
        }


def controls(
    evaluator: Evaluator, data: Sequence[Observations], model: Model, baseline: Model
) -> tuple[Control, ...]:
    """Control every cause of an accepted model under every kind of falsified motions.

    Args:
        evaluator: of the fitted sequences.
        data: their measurements, in the same order.
        model: with the causes.
        baseline: the stated setup, without a cause.
    """
    evaluator.report("trying the causes on motions that were not made")
    chosen = _chosen(evaluator, data, model, baseline)
    others = [[effect for effect in model.effects if effect is not left] for left in model.effects]
    setups = [model.setup, *(with_effects(evaluator.problem.setup, rest) for rest in others)]
    thin = [
        replace(data[n], groups=tuple(data[n].groups[row] for row in rows))
        for n, rows in chosen.items()
    ]
    samples = [
        tuple(model.predictions[n].samples[row] for row in rows) for n, rows in chosen.items()
    ]
    pending = {
        name: [
            evaluator.workers.run(
                _false_patterns, item, setups, evaluator.problem.coarse_grid, points
            )
            for item, points in zip(falsify(thin, evaluator.problem.setup), samples, strict=True)
        ]
        for name, falsify in FALSIFIED.items()
    }
    replayed = {name: [future.result() for future in futures] for name, futures in pending.items()}
    results = []
    for number, left in enumerate(model.effects):
        origin = _origin(evaluator, others[number], model, baseline)
        true = [_pattern(model.predictions[n], origin[n])[rows] for n, rows in chosen.items()]
        patterns = [true, *([own[number] for own in sequences] for sequences in replayed.values())]
        blocks = _blocks(evaluator, origin, model, chosen, patterns, (setups[1 + number], left))
        results += judge(evaluator, blocks, left, tuple(FALSIFIED))
    return tuple(results)


def _chosen(
    evaluator: Evaluator, data: Sequence[Observations], model: Model, baseline: Model
) -> dict[int, list[int]]:
    """Numbers of the sequences that are falsified, each with the numbers of its groups.

    The groups are all that are clear of the phantom, and the most changed ones near it.
    """
    shown = [
        (_pattern(there, here) ** 2 * noise.weights).sum(axis=1)
        for there, here, noise in zip(
            model.predictions, baseline.predictions, evaluator.state.noises, strict=True
        )
    ]
    chosen = {}
    order = [
        number
        for number in np.argsort([-size.sum() for size in shown]).tolist()
        if not data[number].force_only
    ]
    for number in sorted(order[: CRITERIA.controls.most_sequences]):
        groups = data[number].groups
        clear = [row for row, group in enumerate(groups) if group.free or group.reference]
        near = [row for row in np.argsort(-shown[number]).tolist() if row not in clear]
        chosen[number] = sorted([*clear, *near[: CRITERIA.controls.most_groups]])
    return chosen


def _origin(
    evaluator: Evaluator, effects: Sequence[Effect], model: Model, baseline: Model
) -> Sequence[Prediction]:
    """Predictions of the true motions without one cause."""
    if not effects:
        return baseline.predictions
    return [future.result() for future in evaluator.predict(effects, None, model.predictions)]


def _false_patterns(
    item: Observations, setups: Sequence[Setup], grid: Meshing, samples: Sequence[PointSample]
) -> list[FloatArray]:
    """Changes (g, r) from each other setup to the first one along falsified motions."""
    whole = predict(
        item, setups[0], grid, tolerance=CRITERIA.replay.control_tolerance, samples=samples
    )
    others = [
        predict(
            item, setup, grid, None, whole.equilibria, CRITERIA.replay.control_tolerance, samples
        )
        for setup in setups[1:]
    ]
    return [_pattern(whole, other) for other in others]


def _pattern(extended: Prediction, origin: Prediction) -> FloatArray:
    """Change (g, r) by a cause in each row of the noise; zero without an equilibrium or points."""
    change = np.nan_to_num(rows_of(extended)[0] - rows_of(origin)[0])
    change[list({*extended.failed, *origin.failed})] = 0.0
    return change


def _blocks(
    evaluator: Evaluator,
    origin: Sequence[Prediction],
    model: Model,
    chosen: dict[int, list[int]],
    patterns: Sequence[Sequence[FloatArray]],
    added: tuple[Setup, Effect],
) -> list[Block]:
    """Quadratic forms of the residual without the cause; columns are nuisances, patterns, and the
    mesh's error.
    """
    problem = evaluator.problem
    blocks, first = [], problem.blocks.replayed
    for place, (number, index) in enumerate(chosen.items()):
        here = origin[number]
        nuisances = rows_of(model.predictions[number])[1][index][..., :first]
        own = np.stack([pattern[place] for pattern in patterns], axis=2)
        there = here.of_groups(index).replace_columns(np.concatenate([nuisances, own], axis=2))
        block = _of_groups(evaluator.state.noises[number], index).block(there)
        blocks.append(Block(block.name, block.gram / evaluator.state.temperature, block.values))
    if problem.at_rest:
        # The rest cloud saw no motion, so that a cause explains it alike with any motion.
        before, effect = added
        varied = {
            first + place: (effect.apply(before), 1.0)
            for place in range(len(patterns))
            if effect.at_rest()
        }
        blocks.append(
            problem.at_rest.block(
                problem.setup, before, problem.grid, first + len(patterns) + 1, varied
            )
        )
    return blocks


def _of_groups(noise: Noise, index: list[int]) -> Noise:
    """The noise of these groups alone."""
    return Noise(
        noise.weights[index], noise.residual[index], noise.mesh[index], noise.discrepancy[index]
    )


def judge(
    evaluator: Evaluator, blocks: Sequence[Block], effect: Effect, names: Sequence[str]
) -> list[Control]:
    """Compute one control for each name.

    Args:
        evaluator: with the priors of the nuisances.
        blocks: quadratic forms; their columns are nuisances, the true pattern, one falsified
            pattern for each name, and the mesh's error.
        effect: the cause.
        names: of the controls.
    """
    known = evaluator.problem.nuisances.precision
    first = len(known) - 1
    nuisance = (*range(first), first + 1 + len(names))
    own = [
        Candidate(start=effect, columns=(first + number,), spread=(1.0,))
        for number in range(1 + len(names))
    ]
    gains = linear_gains(blocks, right_sides(blocks), nuisance, known, own)[0]
    for number, candidate in enumerate(own):
        if fit(blocks, *candidate.precision(list(nuisance), known)).change[-1] < 0:
            # A pattern with the opposite sign is not the cause.
            gains[number] = min(gains[number], 0.0)
    return [
        Control(
            control=name,
            effect=effect.name,
            gain=float(gains[1 + number]),
            true=float(gains[0]),
            alike=mimicry(blocks, nuisance, known, own[0], own[1 + number]),
        )
        for number, name in enumerate(names)
    ]


def warnings_of(results: Sequence[Control]) -> list[str]:
    """Return one sentence for each control that a cause did not pass."""
    return [
        f"{one.effect} keeps {100 * one.gain / one.true:.0f} % of its gain with the {one.control}: "
        "it may owe it to something else than the pushes"
        for one in results
        if one.passed is False
    ]
