"""An inclusion as a hand would mark it: where on the surface it is felt, and how deep it lies.

The footprint is the outline, on the surface, of where a push meets at least half of the largest
change that the lump makes to the force of such a push. Pushes as deep as those that were made are
replayed with the lump and without, on rings around the place of the surface nearest to it. Depths
are of the lump's centre and of its near side (`cover`), with intervals from the fit: parameters are
drawn as they were fitted, together, since a lump that lies deeper must be larger or stiffer to be
felt as much.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.credible_intervals import spread_of
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.effects.elastic_material import StiffInclusion
from palpate.foundation.arrays import FloatArray
from palpate.mesh.protocol import Meshing
from palpate.mesh.push_meshes import PushMeshSpec
from palpate.replay.replay import Replay
from palpate.setup.setup import Setup

__all__ = ["Footprint", "depth_of", "footprint_of", "outline"]


@dataclass(frozen=True, eq=False)
class Footprint:
    """Where a lump is felt.

    Attributes:
        middle, normal: (3,) place of the surface nearest to the lump [m], and outwards.
        contour: (w, 3) around it [m].
        strongest: largest change of the force of a push that the lump makes [1].
        depth: of such a push [m].
    """

    middle: FloatArray
    normal: FloatArray
    contour: FloatArray
    strongest: float
    depth: float

    @property
    def area(self) -> float:
        """Within the contour, on the plane that touches the surface in the middle [m^2]."""
        return _area(self.contour, self.normal)

    def to_json(self) -> dict[str, Any]:
        """As the report has it, metres."""
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
    bench: Bench, lump: StiffInclusion, without: Setup, depth: float
) -> Footprint | None:
    """Of a lump in an otherwise known body, under pushes so deep [m]; None where it is nowhere
    felt.

    Args:
        without: the setup without the lump.
    """
    geometry = bench.setup.geometry
    centre = np.array([[lump.x, lump.y, lump.z]])
    middle, normal = _on_surface(bench, centre)
    places, normals = _rings(bench, middle[0], normal[0], lump.radius)
    grid = bench.rough.at(places) if isinstance(bench.rough, PushMeshSpec) else bench.rough
    with_lump = lump.apply(without)
    pending = [
        bench.workers.run(_resisting, (without, with_lump), grid, place, out, depth)
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
        * lump.radius
    )
    flat = middle[0] + reach[:, None] * _ways(normal[0])
    distance, out = geometry.facing(flat)
    return Footprint(
        middle[0], normal[0], flat - distance[:, None] * out, float(change.max()), depth
    )


def outline(middle: float, rings: FloatArray, level: float) -> FloatArray:
    """How far from the middle (w,) [radii] the change falls to a level, along each way of rings (r,
    w); linear in between.

    The first fall counts that is followed by no rise above the level; at most the last ring, at
    least half of the first.
    """
    radii = np.array([0.0, *CRITERIA.footprint.rings])
    found = np.empty(rings.shape[1])
    for way, values in enumerate(rings.T):
        along = np.append(middle, values)
        above = np.flatnonzero(along >= level)
        last = int(above[-1]) if len(above) else 0
        if last == len(radii) - 1:
            found[way] = radii[-1]
        elif not len(above):
            found[way] = CRITERIA.footprint.rings[0] / 2
        else:
            share = (along[last] - level) / max(along[last] - along[last + 1], 1e-12)
            found[way] = radii[last] + share * (radii[last + 1] - radii[last])
    return np.maximum(found, CRITERIA.footprint.rings[0] / 2)


def _ways(normal: FloatArray) -> FloatArray:
    """Unit vectors (w, 3) along the surface, evenly around the normal."""
    first = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    turn = 2 * np.pi * np.arange(CRITERIA.footprint.directions) / CRITERIA.footprint.directions
    return np.asarray(
        np.outer(np.cos(turn), first) + np.outer(np.sin(turn), np.cross(normal, first))
    )


def _rings(
    bench: Bench, middle: FloatArray, normal: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """The middle and the rings around it, on the surface, and its normals there (1 + r w, 3)."""
    ways = _ways(normal)
    flat = np.concatenate(
        [middle[None], *(middle + ring * radius * ways for ring in CRITERIA.footprint.rings)]
    )
    distance, out = bench.setup.geometry.facing(flat)
    return flat - distance[:, None] * out, out


def _on_surface(bench: Bench, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places of the free surface (m, 3) [m] nearest to points within the body, and its normals
    there.
    """
    distance, normals = bench.setup.geometry.facing(points)
    return points - distance[:, None] * normals, normals


def _resisting(
    setups: tuple[Setup, Setup], grid: Meshing, place: FloatArray, normal: FloatArray, depth: float
) -> tuple[float, float]:
    """Force [N] against a push into a place (3,) [m] under each setup; NaN where there is no
    equilibrium.
    """
    found = []
    for setup in setups:
        block = Replay(setup, grid, CRITERIA.replay.footprint_tolerance)
        frame = block.solve_from_any(place + (setup.tool.radius - depth) * normal, (None,))
        found.append(
            float(frame.force @ normal) if frame.outcome.name == "CONVERGED" else float("nan")
        )
    return found[0], found[1]


def depth_of(bench: Bench, model: Model, index: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Depth of the centre of a model's lump below the surface, and of its near side, each with a 95
    % interval [m].

    Args:
        index: which of the model's effects the lump is.
    """
    lump = model.effects[index]
    assert isinstance(lump, StiffInclusion)
    at = sum(len(effect.numbers()) for effect in model.effects[:index])
    own = slice(at, at + len(lump.numbers()))
    drawn = [lump.at(row.tolist()) for row in _drawn(bench, model, own)]
    depths = -bench.setup.geometry.facing(
        np.array([[one.x, one.y, one.z] for one in (lump, *drawn)])
    )[0]
    covers = depths - np.array([one.radius for one in (lump, *drawn)])
    return _interval(depths), _interval(np.maximum(covers, 0.0))


def _drawn(bench: Bench, model: Model, own: slice) -> FloatArray:
    """Search coordinates (d, n) of one effect as the fit leaves them: Laplace's correlations,
    deviations as in the intervals.
    """
    columns = [*model.nuisance, *model.columns]
    covariance = fit(bench.tempered(model), columns, bench.precision(model)).covariance
    shift = len(model.nuisance)
    part = covariance[shift + own.start : shift + own.stop, shift + own.start : shift + own.stop]
    wider = spread_of(bench, model)[own] / np.sqrt(np.diag(part))
    draws = np.random.default_rng(0).multivariate_normal(
        np.zeros(len(part)), part * np.outer(wider, wider), size=CRITERIA.footprint.draws
    )
    return np.asarray(model.coordinates[own] + draws)


def _interval(values: FloatArray) -> dict[str, Any]:
    """The first is the value, the others are draws of it."""
    low, high = np.quantile(values[1:], [0.025, 0.975])
    value = float(values[0])
    return {
        "value": value,
        "unit": "m",
        "low": min(float(low), value),
        "high": max(float(high), value),
    }


def _area(contour: FloatArray, normal: FloatArray) -> float:
    apart = contour - contour.mean(axis=0)
    return float(abs(normal @ np.cross(apart, np.roll(apart, -1, axis=0)).sum(axis=0)) / 2)
