"""Footprint and depth of an inclusion in force measurements.

The footprint is the outline, on the surface, of the area in which a push meets at least half of the
largest change of its force by a ball; a tube, which is felt all along, has none. Pushes as deep as
the measured ones are replayed with the ball and without it, on rings around the surface place
nearest to it. Depths are those of the inclusion's centre and of its near side (`cover`). Their
intervals come from joint draws of its fitted parameters, because a deeper inclusion must be larger
or stiffer to have the same effect.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.credible_intervals import spread_of
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.effects import Effect
from palpate.foundation.arrays import FloatArray
from palpate.mesh.protocol import Meshing
from palpate.mesh.push_meshes import PushMeshSpec
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup

__all__ = ["Footprint", "depth_of", "felt_middle", "footprint_of", "outline"]


@dataclass(frozen=True, eq=False)
class Footprint:
    """Area in which an inclusion changes the force of a push.

    Attributes:
        middle: (3,) place of the surface nearest to the inclusion [m].
        normal: (3,) outwards.
        contour: (w, 3) outline on the surface [m].
        strongest: largest relative change of the force [1].
        depth: of the pushes [m].
    """

    middle: FloatArray
    normal: FloatArray
    contour: FloatArray
    strongest: float
    depth: float

    @property
    def area(self) -> float:
        """Area within the contour on the tangent plane in the middle [m^2]."""
        return _area(self.contour, self.normal)

    def to_json(self) -> dict[str, Any]:
        """Plain values in metres, as in the report."""
        return {
            "unit": "m",
            "contour": np.round(self.contour, 5).tolist(),
            "middle": np.round(self.middle, 5).tolist(),
            "normal": np.round(self.normal, 4).tolist(),
            "area": round(self.area, 7),
            "strongest": round(self.strongest, 4),
            "push": round(self.depth, 5),
        }


def footprint_of(
    evaluator: Evaluator, effect: Effect, without: Setup, depth: float
) -> Footprint | None:
    """Compute the footprint of a ball; None if it changes no push, and for a tube.

    Args:
        evaluator: with the stated geometry and the coarse mesh.
        effect: the cause with the inclusion.
        without: the setup without it.
        depth: of the pushes [m].
    """
    inclusion, problem = effect.inclusion, evaluator.problem
    if inclusion is None:
        return None
    geometry, grid = problem.setup.geometry, problem.coarse_grid
    centre = np.array([[inclusion.x, inclusion.y, inclusion.z]])
    middle, normal = _on_surface(evaluator, centre)
    places, normals = _rings(evaluator, middle[0], normal[0], inclusion.radius)
    grid = grid.at(places) if isinstance(grid, PushMeshSpec) else grid
    with_effect = effect.apply(without)
    pending = [
        evaluator.workers.run(_resisting, (without, with_effect), grid, place, out, depth)
        for place, out in zip(places, normals, strict=True)
    ]
    forces = np.array([future.result() for future in pending])
    known = np.isfinite(forces).all(axis=1) & (forces[:, 0] > 0)
    change = np.where(known, np.abs(forces[:, 1] / np.where(known, forces[:, 0], 1.0) - 1.0), 0.0)
    if not change.max(initial=0.0) > 0:
        return None
    reach = (
        outline(
            change[0],
            change[1:].reshape(len(CRITERIA.footprint.rings), CRITERIA.footprint.directions),
            CRITERIA.footprint.level * float(change.max()),
        )
        * inclusion.radius
    )
    flat = middle[0] + reach[:, None] * _directions(normal[0])
    distance, out = geometry.facing_free(flat)
    return Footprint(
        middle[0], normal[0], flat - distance[:, None] * out, float(change.max()), depth
    )


def outline(middle: float, rings: FloatArray, level: float) -> FloatArray:
    """Distances (w,) [radii] from the middle at which the change falls to a level.

    The change is interpolated linearly. The last fall below the level counts; the distance is at
    most that of the last ring and at least half of that of the first.

    Args:
        middle: change in the middle [1].
        rings: (r, w) change on each ring along each direction [1].
        level: [1].
    """
    radii = np.array([0.0, *CRITERIA.footprint.rings])
    distances = np.empty(rings.shape[1])
    for direction, values in enumerate(rings.T):
        along = np.append(middle, values)
        above = np.flatnonzero(along >= level)
        last = int(above[-1]) if len(above) else 0
        if last == len(radii) - 1:
            distances[direction] = radii[-1]
        elif not len(above):
            distances[direction] = CRITERIA.footprint.rings[0] / 2
        else:
            share = (along[last] - level) / max(along[last] - along[last + 1], 1e-12)
            distances[direction] = radii[last] + share * (radii[last + 1] - radii[last])
    return np.maximum(distances, CRITERIA.footprint.rings[0] / 2)


def _directions(normal: FloatArray) -> FloatArray:
    """Unit vectors (w, 3) along the surface, at even angles around the normal."""
    first = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    turn = 2 * np.pi * np.arange(CRITERIA.footprint.directions) / CRITERIA.footprint.directions
    return np.asarray(
        np.outer(np.cos(turn), first) + np.outer(np.sin(turn), np.cross(normal, first))
    )


def _rings(
    evaluator: Evaluator, middle: FloatArray, normal: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Places of middle and rings on the surface, and its normals there, (1 + r w, 3) each."""
    directions = _directions(normal)
    flat = np.concatenate(
        [middle[None], *(middle + ring * radius * directions for ring in CRITERIA.footprint.rings)]
    )
    distance, out = evaluator.problem.setup.geometry.facing_free(flat)
    return flat - distance[:, None] * out, out


def _on_surface(evaluator: Evaluator, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places of the free surface (m, 3) [m] nearest to points in the body, and its normals."""
    distance, normals = evaluator.problem.setup.geometry.facing_free(points)
    return points - distance[:, None] * normals, normals


def _resisting(
    setups: tuple[Setup, Setup], grid: Meshing, place: FloatArray, normal: FloatArray, depth: float
) -> tuple[float, float]:
    """Force [N] against a push into a place (3,) [m] under each setup; NaN without equilibrium."""
    forces = []
    for setup in setups:
        block = Replay(setup, grid, CRITERIA.replay.footprint_tolerance)
        frame = block.solve_from_any(place + (setup.tool.radius - depth) * normal, (None,))
        forces.append(
            float(frame.force @ normal) if frame.outcome.name == "CONVERGED" else float("nan")
        )
    return forces[0], forces[1]


def depth_of(
    evaluator: Evaluator, model: Model, index: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Depths of an inclusion's centre and near side below the surface, with 95 % intervals [m].

    Those of a tube are below the push that is nearest to its axis.

    Args:
        evaluator: of the fitted sequences.
        model: with the inclusion among its effects.
        index: of the inclusion among them.
    """
    effect, problem = model.effects[index], evaluator.problem
    at = sum(len(effect.numbers()) for effect in model.effects[:index])
    own = slice(at, at + len(effect.numbers()))
    drawn = [effect.at(row.tolist()) for row in _drawn(evaluator, model, own)]
    lumps = [lump for one in (effect, *drawn) if (lump := one.lump(problem.setup)) is not None]
    middles = np.array([felt_middle(np.array(lump.polyline), problem.pushes[0]) for lump in lumps])
    depths = -problem.setup.geometry.facing_free(middles)[0]
    covers = depths - np.array([lump.radius for lump in lumps])
    return _interval(depths), _interval(np.maximum(covers, 0.0))


def felt_middle(line: FloatArray, pushes: FloatArray) -> FloatArray:
    """Point (3,) [m] of a line through points (k, 3) [m] that is nearest to a push.

    Args:
        line: centre of a ball, or axis of a tube.
        pushes: places (n, 3) [m] of the pushes on the surface.
    """
    shares = np.linspace(0.0, 1.0, CRITERIA.footprint.along)[:, None]
    pieces = [one + shares * (other - one) for one, other in pairwise(line)]
    points = np.concatenate([line[:1], *pieces])
    apart = np.linalg.norm(points[:, None] - pushes[None], axis=2).min(axis=1)
    return np.asarray(points[int(apart.argmin())])


def _drawn(evaluator: Evaluator, model: Model, own: slice) -> FloatArray:
    """Draw search coordinates (d, n) of one effect.

    Their correlations are those of the Laplace approximation, their deviations those of the
    intervals.
    """
    columns = [*model.nuisance, *model.columns]
    covariance = fit(evaluator.tempered(model), columns, evaluator.precision(model)).covariance
    shift = len(model.nuisance)
    part = covariance[shift + own.start : shift + own.stop, shift + own.start : shift + own.stop]
    wider = spread_of(evaluator, model)[own] / np.sqrt(np.diag(part))
    draws = np.random.default_rng(0).multivariate_normal(
        np.zeros(len(part)), part * np.outer(wider, wider), size=CRITERIA.footprint.draws
    )
    return np.asarray(model.coordinates[own] + draws)


def _interval(values: FloatArray) -> dict[str, Any]:
    """Value and interval of draws (1 + d,), of which the first is the value."""
    low, high = np.quantile(values[1:], [0.025, 0.975])
    value = float(values[0])
    return {
        "value": value,
        "unit": "m",
        "low": min(float(low), value),
        "high": max(float(high), value),
    }


def _area(contour: FloatArray, normal: FloatArray) -> float:
    """Area [m^2] of a polygon (w, 3) projected along a normal (3,)."""
    apart = contour - contour.mean(axis=0)
    return float(abs(normal @ np.cross(apart, np.roll(apart, -1, axis=0)).sum(axis=0)) / 2)
