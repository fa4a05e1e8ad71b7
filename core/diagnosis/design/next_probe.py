"""The next probe: the push that best tells the surviving causes apart.

It is T-optimal in the sense of Atkinson and Fedorov (1975). Each candidate push is replayed under
both models as they were fitted to the data so far. Their difference is weighed against everything
that could blur it: the camera's noise with as many points per patch as so far, the engine's own
error, and the uncertainty of nuisances and of both models' parameters. With squared distance 2 d
the log density ratio after the push is Gaussian with mean d (the Kullback-Leibler divergence) and
variance 2 d, so that the chance of exceeding a bound is known before the push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.design.candidate_pushes import Push, depth_reached, pushes, speed_reached
from palpate.diagnosis.design.predictive_distance import Scene, Survivor, nats_of, survivor
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.noise.noise_model import patch_variance
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.identifiability import Identifiability
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.effects import Effect, Slot
from palpate.foundation.arrays import FloatArray
from palpate.measurement.camera_model import camera_model_for
from palpate.mesh.default_meshes import Use, default_mesh

__all__ = ["Advice", "Pair", "next_probe", "pairs_of"]


@dataclass(frozen=True, eq=False)
class Pair:
    """Two models to tell apart.

    Attributes:
        models: both.
        names: of both.
        needed: nats by which the first must win if it is true, and the second.
        part: share of the second effect that is in question [1]; its nats go with the square.
    """

    models: tuple[Survivor, Survivor]
    names: tuple[str, str]
    needed: tuple[float, float]
    part: float = 1.0

    def chance(self, nats: float) -> float:
        """Return the chance that the new data decide, both models being equally probable."""
        deviation = np.sqrt(2 * max(nats, 1e-9))
        return float(np.mean(norm.cdf((nats - np.array(self.needed)) / deviation)))


@dataclass(frozen=True, eq=False)
class Advice:
    """A push and its expected result.

    Attributes:
        push: to be made.
        pair: that it tells apart best.
        nats: expected of this pair.
        chances: of all pairs together.
    """

    push: Push
    pair: Pair
    nats: float
    chances: float

    def to_json(self) -> dict[str, Any]:
        """Return the row of the report."""
        return {
            "kind": self.push.kind,
            "place": [round(value, 5) for value in self.push.place],
            "direction": (self.push.direction + 0.0).tolist(),
            "depth": round(self.push.depth, 5),
            "separates": list(self.pair.names),
            "nats": round(self.nats, 2),
            "probability": round(self.pair.chance(self.nats), 4),
            "text": self.push.text(),
        }


def next_probe(
    evaluator: Evaluator, data: Sequence[Observations], findings: Findings
) -> list[dict[str, Any]]:
    """Return rows of the report, best first: measurements that are no push, then up to three
    pushes.
    """
    pairs = pairs_of(evaluator, findings)
    if not pairs:
        return []
    evaluator.report("which push would tell most")
    setups = [model.setup for pair in pairs for model in pair.models]
    clocks = len({setup.sensor.time_offset for setup in setups}) > 1
    memory = any(setup.material.has_history for setup in setups)
    drags = any(
        setup.support.friction_coefficient is not None or setup.tool.friction_coefficient
        for setup in setups
    )
    speed = (
        speed_reached(data, evaluator.problem.setup) * (CRITERIA.design.fast if clocks else 1.0)
        if clocks or memory
        else 0.0
    )
    tried = pushes(
        evaluator.problem.setup,
        depth_reached(data, evaluator.problem.setup),
        drags=drags,
        speed=speed,
        holds=(0.0, CRITERIA.design.hold) if memory else (0.0,),
    )
    scene = _scene(evaluator, findings, np.array([push.place for push in tried]))
    pending = [
        evaluator.workers.run(nats_of, scene, [pair.models for pair in pairs], push)
        for push in tried
    ]
    found = [
        _advice(push, pairs, future.result()) for push, future in zip(tried, pending, strict=True)
    ]
    return [
        *_other_measurements(evaluator.problem.catalogue, pairs),
        *(one.to_json() for one in _choices(sorted(found, key=lambda one: -one.chances))),
    ]


def _scene(evaluator: Evaluator, findings: Findings, places: FloatArray) -> Scene:
    """Return what all candidate pushes at these places (k, 3) [m] share, with the visibility so
    far.
    """
    setup = evaluator.problem.setup
    predictions, surface = (
        [item for item in findings.baseline.predictions if not item.force_only],
        evaluator.problem.surface,
    )
    counts = [item.count[[frame.in_contact for frame in item.equilibria]] for item in predictions]
    return Scene(
        stated=survivor(evaluator, findings.baseline),
        lumps=inclusion_places(evaluator.problem),
        centres=surface.patch_centres,
        normals=surface.patch_normals,
        count=np.concatenate(counts).mean(axis=0),
        variance=patch_variance(predictions),
        eye=camera_model_for(evaluator.problem.setup).pose.translation,
        pivot=evaluator.problem.registration.robot_pivot,
        grid=default_mesh(Use.SCREEN, setup.geometry, setup.tool.radius, places),
        temperature=evaluator.state.temperature,
    )


def _advice(push: Push, pairs: Sequence[Pair], nats: list[tuple[float, float]]) -> Advice:
    """Return the push at the least sufficient depth, with the pair that it tells apart best."""
    full = [pair.part**2 * both[1] for pair, both in zip(pairs, nats, strict=True)]
    half = [pair.part**2 * both[0] for pair, both in zip(pairs, nats, strict=True)]
    chances = [pair.chance(value) for pair, value in zip(pairs, full, strict=True)]
    best = int(np.argmax(full))
    if (
        half[best] >= CRITERIA.design.half_depth_share * full[best]
        and push.kind != "drag"
        and not push.speed
    ):
        push, full = push.half(), half
    return Advice(
        push, pairs[best], full[best], float(np.sum(chances)) + 1e-6 * float(np.sum(full))
    )


def _choices(found: Sequence[Advice]) -> list[Advice]:
    """Return the first few pushes, each of another kind and side.

    Not every place can be reached in every laboratory.
    """
    chosen: list[Advice] = []
    for one in found:
        same = any(
            (other.push.kind, other.push.side) == (one.push.kind, one.push.side) for other in chosen
        )
        if not same and one.nats > 0:
            chosen.append(one)
    return chosen[: CRITERIA.design.shown]


def _other_measurements(
    catalogue: Sequence[type[Effect]], pairs: Sequence[Pair]
) -> list[dict[str, Any]]:
    """Return measurements that are no push, for pairs that differ in two effects told apart by it.

    Args:
        catalogue: of the effects, which state these measurements.
        pairs: to tell apart.
    """
    kinds, rows = {kind.name: kind for kind in catalogue}, []
    for pair in pairs:
        names = [set(name.split(" + ")) for name in pair.names]
        differing = names[0] ^ names[1]
        texts = {
            kinds[name].told_apart_by[other]
            for name in differing & set(kinds)
            for other in differing
            if other in kinds[name].told_apart_by
        }
        if len(differing) == 2:
            rows += [
                {"kind": "measurement", "separates": list(pair.names), "text": text}
                for text in sorted(texts)
            ]
    return rows


def pairs_of(evaluator: Evaluator, findings: Findings) -> list[Pair]:
    """Return the pairs to be told apart.

    These are the best model and its rivals, else the best model and the next one, else no cause and
    the effects that stay hidden at the largest size.
    """
    best = findings.best
    if best is None:
        return [] if findings.structure.significant else _imagined(evaluator, findings)
    others: list[Trial] = findings.rivals() or _next_best(findings, best)
    mine, name = survivor(evaluator, best.model), " + ".join(best.model.names)
    pairs = []
    for trial in others:
        lead = (
            max(best.gain - trial.gain, 0.0)
            if best.gain - trial.gain < CRITERIA.naming.rival
            else 0.0
        )
        names = (name, " + ".join(trial.model.names))
        pairs.append(
            Pair(
                (mine, survivor(evaluator, trial.model)),
                names,
                (CRITERIA.naming.rival - lead, CRITERIA.naming.rival + lead),
            )
        )
    return pairs or [
        Pair(
            (mine, survivor(evaluator, findings.baseline)),
            (name, "none"),
            (findings.bound, findings.bound),
        )
    ]


def _next_best(findings: Findings, best: Trial) -> list[Trial]:
    """Return the next best set of other causes; none where the best one is far ahead."""
    others = [
        trial
        for trial in findings.trials
        if trial.model.names != best.model.names and trial.model.effects
    ]
    return [trial for trial in others[:1] if best.gain - trial.gain < CRITERIA.design.settled_gap]


def _imagined(evaluator: Evaluator, findings: Findings) -> list[Pair]:
    """Return pairs of no cause and the effects with the highest detection limits.

    Each effect is as large as it may be without being named.
    """
    nothing, needed = survivor(evaluator, findings.baseline), (findings.bound, findings.bound)
    others = [
        one
        for one in findings.identifiability
        if one.candidate.start.enters not in (Slot.LOAD, Slot.SENSOR)
    ]
    pairs = []
    for one in sorted(others, key=lambda one: -_hidden(one))[: CRITERIA.design.simulated_effects]:
        effect, part = _at_limit(one)
        pairs.append(
            Pair(
                (nothing, Survivor(effect.apply(evaluator.problem.setup))),
                ("none", one.effect),
                needed,
                part,
            )
        )
    return pairs


def _hidden(one: Identifiability) -> float:
    """Return the largest detection limit over its prior deviation [1]."""
    spread = [*one.candidate.widened.values(), *one.candidate.spread]
    return max(limit.size / deviation for limit, deviation in zip(one.limits, spread, strict=True))


def _at_limit(one: Identifiability) -> tuple[Effect, float]:
    """Return the effect at its detection limit, or a finite effect and the share of it [1]."""
    start, limit = one.candidate.start, one.limits[0]
    if limit.item is None:
        return start, min(limit.size, 1.0)
    number = [item.name for item in start.numbers()].index(limit.item.name)
    coordinates, item = start.coordinates, start.numbers()[number]
    above, below = (
        item.coordinate(item.high) - coordinates[number],
        coordinates[number] - item.coordinate(item.low),
    )
    coordinates[number] += (
        min(limit.size, above) if above >= min(limit.size, below) else -min(limit.size, below)
    )
    return start.at(coordinates), 1.0
