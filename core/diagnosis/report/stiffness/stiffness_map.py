"""A free map of the stiffness: how stiff each part of the body is over what is usual in it, and
where the data can tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.report.stiffness.felt_pushes import FeltPush, felt_pushes
from palpate.diagnosis.report.stiffness.map_cells import MapCells, cells_near
from palpate.diagnosis.report.stiffness.map_posterior import FieldPosterior, field_posterior
from palpate.diagnosis.search.findings import Findings
from palpate.effects import Linearisation
from palpate.effects.parameter import Parameter
from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Geometry

__all__ = ["MappedValues", "StiffnessMap", "stiffness_map", "stiffness_map_of"]

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
_RATIO = Parameter(name="stiffness_ratio", unit="1", low=0.05, high=20.0, contrast=True)


@dataclass(frozen=True, eq=False)
class MappedValues:
    """Stiffness over the usual one at n places.

    Attributes:
        places: (n, 3) phantom frame [m].
        mean: (n,) contrast [1].
        deviation: (n,) of the posterior and of the engine [1].
        left: (n,) share of the prior deviation that the data leave [1].
    """

    places: FloatArray
    mean: FloatArray
    deviation: FloatArray
    left: FloatArray

    @property
    def trusted(self) -> BoolArray:
        """Whether (n,) the data tell the stiffness of each place."""
        return np.asarray(self.left < CRITERIA.stiffness_map.most_left)

    @property
    def ends(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Ratio (n,) [1], and the ends of its 95 % interval."""
        half = CRITERIA.intervals.normal_quantile * self.deviation
        low, value, high = (
            np.array([_RATIO.value(one) for one in values])
            for values in (self.mean - half, self.mean, self.mean + half)
        )
        return value, low, high

    @property
    def unusual(self) -> BoolArray:
        """Whether (n,) a trusted place is surely stiffer or softer than usual."""
        return np.asarray(
            self.trusted & (np.abs(self.mean) > CRITERIA.intervals.normal_quantile * self.deviation)
        )


@dataclass(frozen=True, eq=False)
class StiffnessMap:
    """A free map of the stiffness.

    Attributes:
        cells: in which the stiffness may differ.
        field: posterior of their contrast.
        pushes: of all fitted sequences.
        usual: (m,) weights of the cells whose mean is the usual stiffness; their sum is one.
        surface: places (n, 3) of the free surface that are mapped [m].
        spread: (n, m) weights of the cells below each of them; zero without any.
        ends: names of the ends of the body at which hardly anything is trusted, such as "-x".
    """

    cells: MapCells
    field: FieldPosterior
    pushes: tuple[FeltPush, ...]
    usual: FloatArray
    surface: FloatArray
    spread: FloatArray
    ends: tuple[str, ...] = ()

    @property
    def structured(self) -> bool:
        """Whether chance hardly gives a uniform body so much structure."""
        return self.field.gain > self.field.bound

    def values(self, places: FloatArray, weights: FloatArray) -> MappedValues:
        """Return means over cells, by weights (n, m) whose rows add up to one, at places (n, 3)."""
        known = weights.sum(axis=1) > 0
        own = np.where(known[:, None], weights - self.usual, 0.0)
        after, before = (
            np.sqrt(np.maximum(np.einsum("nm,mk,nk->n", own, matrix, own), 0.0))
            for matrix in (self.field.covariance, self.field.prior)
        )
        left = np.where(known & (before > 0), after / np.where(before > 0, before, 1.0), 1.0)
        deviation = np.hypot(after, CRITERIA.stiffness_map.accuracy)
        return MappedValues(places, own @ self.field.mean, deviation, left)

    @property
    def inside(self) -> MappedValues:
        """Values of the cells."""
        return self.values(self.cells.centres, np.eye(len(self.cells.centres)))

    @property
    def on_surface(self) -> MappedValues:
        """Values below the free surface."""
        return self.values(self.surface, self.spread)

    @property
    def felt(self) -> MappedValues:
        """Values that each push feels: the mean over the cells by their share in its data."""
        signal = np.array([push.signal for push in self.pushes])
        shares = signal / np.maximum(signal.sum(axis=1, keepdims=True), 1e-300)
        return self.values(np.array([push.place for push in self.pushes]), shares)

    def carriers(self, weights: FloatArray) -> list[int]:
        """Return the numbers of the pushes that feel cells, with weights (m,), most."""
        signal = np.array([push.signal @ weights for push in self.pushes])
        strong = signal >= CRITERIA.stiffness_map.carried * signal.max(initial=0.0)
        return [
            push.number
            for push, one, size in zip(self.pushes, strong, signal, strict=True)
            if one and size > 0
        ]


def stiffness_map_of(
    evaluator: Evaluator, data: Sequence[Observations], findings: Findings, verdict: str, seed: int
) -> StiffnessMap | None:
    """Return the map of a diagnosis that has left something open; None for others.

    The map stands beside the causes that are no part of other stiffness: these it shows itself.
    """
    best = findings.best
    left = verdict in ("unexplained", "ambiguous") or findings.remaining.significant
    if not (left or not evaluator.problem.clouds) or not len(evaluator.problem.contacts[0]):
        return None
    evaluator.report("mapping the stiffness")
    model = best.model if best else findings.baseline
    kept = [
        effect
        for effect in model.effects
        if effect.linearisation is not Linearisation.LOCAL_STIFFNESS
    ]
    origin = model if len(kept) == len(model.effects) else findings.baseline
    return stiffness_map(evaluator, data, replace(origin, effects=tuple(kept)), seed)


def stiffness_map(
    evaluator: Evaluator, data: Sequence[Observations], start: Model, seed: int
) -> StiffnessMap | None:
    """Return the map beside the effects of a model; None where no push feels a cell.

    Args:
        evaluator: of the fitted sequences, with their noise.
        data: the same sequences.
        start: its effects stay, and its predictions are where the replays begin.
        seed: of the draws of a uniform body.
    """
    problem = evaluator.problem
    body, radius = problem.setup.geometry, problem.setup.tool.radius
    cells = cells_near(problem.contacts[0], body, radius)
    if len(cells.centres) < 2:
        return None
    model = evaluator.evaluate(start.effects, start.predictions or None, (), cells.balls)
    field = _settled(evaluator, model, cells, radius, seed)
    pushes = felt_pushes(evaluator, data, model)
    if not pushes or not (field.felt > 0).any():
        return None
    surface = _thinned(body.surface_points(), cells.spacing)
    spread = _below(surface, body, cells, radius)
    made = StiffnessMap(cells, field, pushes, _usual(field), surface, spread)
    return replace(made, ends=_unfelt_ends(made.on_surface, body))


def _settled(
    evaluator: Evaluator, model: Model, cells: MapCells, radius: float, seed: int
) -> FieldPosterior:
    """Return the field at the temperature of what it leaves, not of what a uniform body does."""
    columns, precision = [*model.nuisance, *model.columns], evaluator.bounded_precision(model)
    values = sum(block.values for block in model.blocks if block.name != "rest")

    def at(temperature: float) -> FieldPosterior:
        blocks = [
            Block(one.name, one.gram / (1.0 if one.name == "rest" else temperature), one.values)
            for one in model.blocks
        ]
        own = model.layout.inclusions
        return field_posterior(blocks, columns, precision, own, cells.centres, radius, seed)

    temperature = max(evaluator.state.temperature, 1.0)
    first = at(temperature)
    own = max(1.0, temperature * first.misfit / max(values, 1.0))
    return first if own == temperature else at(own)


def _usual(field: FieldPosterior) -> FloatArray:
    """Weights (m,) of the cells that are about as stiff as the middle one of what is felt."""
    weights = np.maximum(field.felt, 0.0) / max(float(np.maximum(field.felt, 0.0).sum()), 1e-300)
    order = np.argsort(field.mean)
    middle = field.mean[order[int(np.searchsorted(np.cumsum(weights[order]), 0.5))]]
    near = np.abs(field.mean - middle) <= np.sqrt(np.diag(field.covariance))
    chosen = np.where(near, weights, 0.0)
    return np.asarray(chosen / chosen.sum())


def _thinned(points: FloatArray, spacing: float) -> FloatArray:
    """Choose points (n, 3) [m], about one for each cube of a spacing [m]."""
    _, first = np.unique(np.floor(points / spacing + 0.5), axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


def _below(places: FloatArray, body: Geometry, cells: MapCells, radius: float) -> FloatArray:
    """Weights (n, m) of the cells below places of the surface, as deep as a push feels most."""
    normals = body.facing_free(places)[1]
    width = max(radius, cells.spacing)
    middles = places - width * normals
    apart = np.linalg.norm(middles[:, None] - cells.centres, axis=2) / width
    weights = np.where(apart < 2.0, np.exp(-0.5 * (2.0 * apart) ** 2), 0.0)
    return np.asarray(weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300))


def _unfelt_ends(surface: MappedValues, body: Geometry) -> tuple[str, ...]:
    """Names of the sides of the body near which hardly any place of its surface is trusted."""
    found, size = [], body.high - body.low
    share = CRITERIA.stiffness_map.end_share
    for axis, letter in enumerate("xyz"):
        for sign, end in (("-", body.low), ("+", body.high)):
            near = np.abs(surface.places[:, axis] - end[axis]) < share * size[axis]
            told = surface.trusted[near].mean() if near.any() else 1.0
            if sign + letter != "-z" and told < CRITERIA.stiffness_map.end_told:
                found.append(sign + letter)
    return tuple(found)
