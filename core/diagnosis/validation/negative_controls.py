"""Controls of a named cause: with motions that were not made, it must lose its gain (step 13 of the
method).

What the stated model leaves unexplained stays as it was measured, and so do weights, discrepancy
and nuisances. Only the cause's pattern, what it changes from group to group and patch to patch, is
replayed along falsified motions (`palpate.diagnosis.validation.falsified_motions`), and the gain of
that pattern is taken as that of the true one is: by sequences left out. Were the clouds themselves
compared with falsified replays, each dent would be missing here and too many there, and whatever
makes dents shallower would seem to gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction, predict
from palpate.diagnosis.forward.ray_comparison import PointSample
from palpate.diagnosis.inference.evidence import Block, fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.noise_model import Noise, rows_of
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
        effect: the cause.
        gain: of the falsified pattern, and true: of the cause's own [nats], both on the groups that
            were falsified.
        alike: share of the cause's pattern that falsified motions imitate [1].
    """

    control: str
    effect: str
    gain: float
    true: float
    alike: float

    @property
    def passed(self) -> bool | None:
        """Whether the gain was lost; None where the control says nothing of this cause."""
        return (
            None
            if self.why
            else self.gain < max(CRITERIA.controls.retained * self.true, CRITERIA.controls.faint)
        )

    @property
    def why(self) -> str:
        """Why the control says nothing; empty where it does."""
        if self.alike > CRITERIA.controls.alike:
            return f"with these motions {self.effect} would look {100 * self.alike:.0f} % as it does with the true ones"
        return (
            f"{self.effect} gains too little on these frames to lose it"
            if self.true <= CRITERIA.controls.faint
            else ""
        )

    def to_json(self) -> dict[str, Any]:
        """As the report has it."""
        kept = None if self.true <= CRITERIA.controls.faint else round(self.gain / self.true, 4)
        return {
            "control": self.control,
            "effect": self.effect,
            "gain_nats": round(self.gain, 2),
            "true_nats": round(self.true, 2),
            "kept": kept,
            "alike": round(self.alike, 4),
            "passed": self.passed,
            **({"why": self.why} if self.why else {}),
        }


def controls(
    bench: Bench, data: Sequence[Observations], model: Model, baseline: Model
) -> tuple[Control, ...]:
    """Every cause of an accepted model under every kind of falsified motions.

    Args:
        data: what the bench's sequences are, in its order.
        baseline: the stated setup, which is the model without a single cause.
    """
    bench.tell("trying the causes on motions that were not made")
    chosen = _chosen(bench, data, model, baseline)
    others = [[effect for effect in model.effects if effect is not left] for left in model.effects]
    setups = [model.setup, *(with_effects(bench.setup, rest) for rest in others)]
    thin = [
        replace(data[n], groups=tuple(data[n].groups[row] for row in rows))
        for n, rows in chosen.items()
    ]
    samples = [
        tuple(model.predictions[n].samples[row] for row in rows) for n, rows in chosen.items()
    ]
    pending = {
        name: [
            bench.workers.run(_false_patterns, item, setups, bench.rough, points)
            for item, points in zip(falsify(thin, bench.setup), samples, strict=True)
        ]
        for name, falsify in FALSIFIED.items()
    }
    replayed = {name: [future.result() for future in futures] for name, futures in pending.items()}
    found = []
    for number, left in enumerate(model.effects):
        origin = _origin(bench, others[number], model, baseline)
        true = [_pattern(model.predictions[n], origin[n])[rows] for n, rows in chosen.items()]
        patterns = [true, *([own[number] for own in sequences] for sequences in replayed.values())]
        blocks = _blocks(bench, origin, model, chosen, patterns, (setups[1 + number], left))
        found += judge(bench, blocks, left, tuple(FALSIFIED))
    return tuple(found)


def _chosen(
    bench: Bench, data: Sequence[Observations], model: Model, baseline: Model
) -> dict[int, list[int]]:
    """Number of each sequence that is falsified to its groups: all that are clear of the block, and
    some near it.
    """
    shown = [
        (_pattern(there, here) ** 2 * noise.weights).sum(axis=1)
        for there, here, noise in zip(
            model.predictions, baseline.predictions, bench.noises, strict=True
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
    bench: Bench, effects: Sequence[Effect], model: Model, baseline: Model
) -> Sequence[Prediction]:
    """The true motions without one cause."""
    if not effects:
        return baseline.predictions
    return [future.result() for future in bench.predict(effects, None, model.predictions)]


def _false_patterns(
    item: Observations, setups: Sequence[Setup], grid: Meshing, samples: Sequence[PointSample]
) -> list[FloatArray]:
    """What tells the first setup from each of the others (g, r) along falsified motions, at points
    that are settled.
    """
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
    """What a cause changes in each row of the noise (g, r); zero where a replay failed or a patch
    was lost.
    """
    change = np.nan_to_num(rows_of(extended)[0] - rows_of(origin)[0])
    change[list({*extended.failed, *origin.failed})] = 0.0
    return change


def _blocks(
    bench: Bench,
    origin: Sequence[Prediction],
    model: Model,
    chosen: dict[int, list[int]],
    patterns: Sequence[Sequence[FloatArray]],
    added: tuple[Setup, Effect],
) -> list[Block]:
    """Quadratic forms of what the model without the cause leaves; columns are nuisances, patterns,
    and the mesh's error.
    """
    blocks, first = [], len(bench.nuisances.precision) - 1
    for place, (number, index) in enumerate(chosen.items()):
        here = origin[number]
        nuisances = rows_of(model.predictions[number])[1][index][..., :first]
        own = np.stack([pattern[place] for pattern in patterns], axis=2)
        there = here.of_groups(index).replace_columns(np.concatenate([nuisances, own], axis=2))
        block = _of_groups(bench.noises[number], index).block(there)
        blocks.append(Block(block.name, block.gram / bench.temperature, block.values))
    if bench.static:
        # The rest cloud saw no motion at all: what a cause explains of it, it explains with any.
        before, effect = added
        varied = {
            first + place: (effect.apply(before), 1.0)
            for place in range(len(patterns))
            if effect.at_rest()
        }
        blocks.append(
            bench.static.block(bench.setup, before, bench.grid, first + len(patterns) + 1, varied)
        )
    return blocks


def _of_groups(noise: Noise, index: list[int]) -> Noise:
    return Noise(
        noise.weights[index], noise.residual[index], noise.mesh[index], noise.discrepancy[index]
    )


def judge(
    bench: Bench, blocks: Sequence[Block], effect: Effect, names: Sequence[str]
) -> list[Control]:
    """One control for each of the names; columns of the blocks are nuisances, the true pattern, one
    for each name, mesh error.
    """
    known = bench.nuisances.precision
    first = len(known) - 1
    nuisance = (*range(first), first + 1 + len(names))
    own = [
        Candidate(start=effect, columns=(first + number,), spread=(1.0,))
        for number in range(1 + len(names))
    ]
    gains = linear_gains(blocks, right_sides(blocks), nuisance, known, own)[0]
    for number, candidate in enumerate(own):
        if fit(blocks, *candidate.precision(list(nuisance), known)).change[-1] < 0:
            gains[number] = min(gains[number], 0.0)  # the cause's opposite is not the cause
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


def warnings_of(found: Sequence[Control]) -> list[str]:
    """One sentence for each control that a cause did not pass."""
    return [
        f"{one.effect} keeps {100 * one.gain / one.true:.0f} % of its gain with the {one.control}: "
        "it may owe it to something else than the pushes"
        for one in found
        if one.passed is False
    ]
