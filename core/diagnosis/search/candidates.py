"""The catalogue as columns of one linear problem: what every effect would do to the data, and where
its refit would begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import TRACED
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.effect_derivative import Tangent
from palpate.diagnosis.inference.evidence import within_reach
from palpate.diagnosis.inference.hypothesis import TWINS, Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.inference.mesh_discrepancy import OWN_GRID
from palpate.diagnosis.search.inclusion_grid import lumps_under
from palpate.diagnosis.search.screening import Candidate
from palpate.effects import OUTSIDE, Effect
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.geometry import GeometryScale, MeshResolution
from palpate.effects.heterogeneity import (
    Anisotropy,
    StiffnessGradient,
    StrainStiffening,
    SurfaceLayer,
)
from palpate.effects.load import Gravity
from palpate.effects.sensor import DepthBias, TimeOffset
from palpate.effects.support import BaseCompliance, BaseDetachment, BaseSlip
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity
from palpate.effects.tool import LandmarkMismatch, ToolCompliance, ToolFriction
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Inclusion, Setup

__all__ = [
    "FINITE",
    "Signature",
    "begin",
    "candidates_of",
    "lump_places",
    "mesh_candidate",
    "renewed",
    "signatures",
    "tangents",
]

Signature = tuple[Effect, list[Prediction]]
"""An effect of a finite size, and every sequence replayed with it."""

FINITE: tuple[type[Effect], ...] = (BaseSlip, BaseDetachment, Gravity, BaseCompliance, *OUTSIDE)
"""Effects without a derivative where they are nothing: a base that is held and one that may move
have other unknowns, and sag moves the registration, too."""
_SUPPORTS: tuple[type[Effect], ...] = (BaseSlip, BaseDetachment, BaseCompliance)
"""What lets the base move: how it does hangs on the block's weight, and how the block sags on
it."""
_TOGETHER: tuple[type[Effect], ...] = (DepthBias, GeometryScale, LandmarkMismatch)
"""Effects whose numbers are one candidate: what each does alone is as good as any."""


def lump_places(bench: Bench) -> tuple[Inclusion, ...]:
    """Places of the coarse grid of inclusions; without clouds those under the pushes."""
    if not bench.seen:
        return lumps_under(*bench.pushed, bench.setup.geometry)
    return tuple(
        Inclusion(x=s.x, y=s.y, z=s.z, radius=s.radius, stiffness_ratio=s.stiffness_ratio)
        for s in StiffInclusion.starts(bench.setup)
    )


def tangents(
    setup: Setup, besides: Sequence[str] = (), weighed: Sequence[type[Effect]] = ()
) -> tuple[Tangent, ...]:
    """Effects whose action grows in proportion to a number near nothing, in this setup and not
    `besides`; those that are `weighed`.

    Against replays at a finite size (a skin of 0.3 and 4 times, gradients of 0.7 and -1.2, J_m of 1
    and 3, fibres of 3) the columns have correlations of 0.98, 0.999, 0.99 and 0.95 over the
    whitened data of a whole dataset, for a thirtieth of the time.
    """
    ratio = ("stiffness_ratio", 2.0)
    found = [
        _step(TimeOffset.neutral(setup), "offset"),
        *(
            _step(SurfaceLayer(thickness=thickness, stiffness_ratio=1.0), *ratio)
            for thickness in (2e-3, 5e-3)
        ),
        _step(StiffnessGradient.neutral(setup), "log_ratio"),
        Tangent(effect=StrainStiffening(J_m=CRITERIA.screening.strain_limit), spread=1.0),
        *(_step(replace(start, stiffness_ratio=1.0), *ratio) for start in Anisotropy.starts(setup)),
        _step(ToolCompliance.neutral(setup), "compliance_times_stiffness"),
        *(_step(kind.neutral(setup), item.name) for kind in _TOGETHER for item in kind.numbers()),
    ]
    kinds = tuple(weighed)
    return tuple(
        item
        for item in found
        if item.effect.name not in besides and (not kinds or isinstance(item.effect, kinds))
    )


def _step(effect: Effect, name: str, spread: float | None = None) -> Tangent:
    scale = next(item.scale for item in effect.numbers() if item.name == name)
    return Tangent(
        effect=effect,
        of=name,
        spread=CRITERIA.priors.parameter_steps * scale if spread is None else spread,
    )


def signatures(bench: Bench, baseline: Model) -> list[Signature]:
    """What effects without a derivative at their neutral value do at finite sizes, by the
    difference of two rough replays.

    Sag alone is replayed on the mesh of the diagnosis: on the rough one its pattern has a
    correlation of 0.89 with what it should be, the others' 0.99.
    """
    starts = [
        effect for kind in FINITE if kind in bench.weighed for effect in kind.starts(bench.setup)
    ]
    found: list[Signature] = (
        [(OWN_GRID, [one.without_details() for one in bench.on_own_grid])]
        if bench.on_own_grid
        else []
    )
    return [*found, *_replayed(bench, baseline, starts, baseline), *_traced(bench, baseline)]


def renewed(
    bench: Bench, model: Model, finite: Sequence[Signature], origin: Model
) -> list[Signature]:
    """Signatures over `origin` for use on top of a model: what weight does is made anew, and under
    a heavy block what supports do.

    A block that sags is met later, and what of the push is then missing hangs on all that shapes
    the push: with its signature under a tool of 6 mm, weight had a linear gain of -4 nats on top of
    one of 3.7 mm, and 303 with its own. A block that may slide sags another way than one that is
    held, and its weight is what presses it on the table (350 and 1255 nats).
    """
    heavy = any(isinstance(effect, Gravity) for effect in model.effects)
    kinds = (*(_SUPPORTS if heavy else ()), *((Gravity,) if model.effects else ()))
    starts = [
        effect
        for effect, _ in finite
        if isinstance(effect, kinds) and effect.name not in model.names
    ]
    if not starts:
        return list(finite)
    anew = dict(_replayed(bench, model, starts, origin))
    return [(effect, anew.get(effect, predictions)) for effect, predictions in finite]


def _replayed(
    bench: Bench, model: Model, starts: Sequence[Effect], origin: Model
) -> list[Signature]:
    """What these effects change in a model, put upon the predictions of `origin`."""
    meshes, rough = [_mesh_for(effect, bench) for effect in starts], list[Prediction]()
    if any(mesh is not bench.grid for mesh in meshes):
        rough = [
            future.result()
            for future in bench.predict(model.effects, None, model.predictions, bench.rough)
        ]
    known = [model.predictions if mesh is bench.grid else rough for mesh in meshes]
    pending = [
        bench.predict(
            [*model.effects, effect], None, without, mesh, CRITERIA.replay.screening_tolerance
        )
        for effect, without, mesh in zip(starts, known, meshes, strict=True)
    ]
    found: list[Signature] = []
    for number, (effect, without, futures) in enumerate(zip(starts, known, pending, strict=True)):
        bench.tell(f"what {effect.name} would do", 0.15 + 0.25 * number / len(pending))
        changed = [future.result() for future in futures]
        rows = zip(origin.predictions, changed, without, strict=True)
        found.append(
            (
                effect,
                [other.transferred(here, zero).without_details() for here, other, zero in rows],
            )
        )
    return found


def _traced(bench: Bench, baseline: Model) -> list[Signature]:
    """What hangs on the past would do, to first order, for the cost of a few solves a group (see
    `palpate.diagnosis.forward.history_columns`).
    """
    if any(item.force_only for item in baseline.predictions):
        return []  # short pushes that are felt alone leave nothing behind to be seen
    starts = [
        effect for kind in TRACED if kind in bench.weighed for effect in kind.starts(bench.setup)
    ]
    if not starts:
        return []
    bench.tell("what the material or the tool would remember", 0.4)
    pending = bench.workers.trace(
        bench.names, baseline.setup, bench.grid, baseline.predictions, starts
    )
    traces = [future.result() for future in pending]
    rows = list(zip(traces, baseline.predictions, strict=True))
    return [
        (effect, [own[number].on(plain).without_details() for own, plain in rows])
        for number, effect in enumerate(starts)
    ]


def _mesh_for(effect: Effect, bench: Bench) -> Meshing:
    return bench.grid if isinstance(effect, Gravity) else bench.rough


def candidates_of(model: Model, bench: Bench, finite: Sequence[Signature]) -> list[Candidate]:
    """Every effect of the catalogue that is not in the model yet, as columns of it."""
    setup, found = model.setup, []
    for kind, columns in TWINS.items():
        if kind not in bench.weighed:
            continue
        effect = kind.neutral(setup)
        spreads = [CRITERIA.priors.parameter_steps * item.scale for item in effect.numbers()]
        names = tuple(item.name for item in effect.numbers())
        found.append(
            Candidate(start=effect, of=names, widened=dict(zip(columns, spreads, strict=True)))
        )
    for rows in _same_effect(model):
        of, places = (
            tuple(tangent.of for _, tangent in rows if tangent.of),
            tuple(place for place, _ in rows),
        )
        found.append(
            Candidate(
                start=rows[0][1].effect,
                of=of,
                columns=places,
                spread=tuple(one.spread for _, one in rows),
            )
        )
    for place, lump in zip(model.extra["lumps"], lump_places(bench), strict=True):
        start = StiffInclusion(
            x=lump.x, y=lump.y, z=lump.z, radius=lump.radius, stiffness_ratio=1.0
        )
        found.append(
            Candidate(
                start=start,
                of=("stiffness_ratio",),
                columns=(place,),
                spread=(CRITERIA.screening.inclusion_contrast,),
            )
        )
    for place, (effect, predictions) in zip(model.extra.get("signatures", ()), finite, strict=True):
        if any(
            np.isfinite(p.gap).any() or (p.forces is not None and np.isfinite(p.forces.gap).any())
            for p in predictions
        ):
            found.append(Candidate(start=effect, columns=(place,), spread=(1.0,)))
    found += (
        [mesh_candidate(model)] if MeshResolution in bench.weighed and not bench.on_own_grid else []
    )
    return [candidate for candidate in found if candidate.start.name not in model.names]


def _same_effect(model: Model) -> list[list[tuple[int, Tangent]]]:
    """The model's tangents with their columns; those of one effect that are weighed together in one
    list.
    """
    found: list[list[tuple[int, Tangent]]] = []
    for place, tangent in zip(model.extra["tangents"], model.tangents, strict=True):
        if (
            isinstance(tangent.effect, _TOGETHER)
            and found
            and found[-1][0][1].effect == tangent.effect
        ):
            found[-1].append((place, tangent))
        else:
            found.append([(place, tangent)])
    return found


def begin(
    candidate: Candidate, model: Model, bench: Bench, beside: Candidate | None = None
) -> Effect:
    """Where to begin the refit: at the size that the linear fit asks for, where the column tells of
    a size.

    With another candidate `beside` it, what both ask for together.
    """
    start, together = candidate.start, candidate if beside is None else candidate.beside(beside)
    columns, precision = together.precision(list(model.nuisance), bench.nuisances.precision)
    limits = {
        place: scale for one in (candidate, beside) if one for place, scale in _limited(one).items()
    }
    own, scales = [columns.index(place) for place in limits], np.array(list(limits.values()))
    asked = within_reach(
        bench.tempered(model), columns, precision, own, scales, CRITERIA.fits.trust
    )
    if limited := _limited(candidate):
        changes = asked[[columns.index(place) for place in limited]]
        return start.at((np.array(start.coordinates) + changes).tolist())
    if start == OWN_GRID or isinstance(
        start, (TimeOffset, BaseSlip, BaseDetachment, Gravity, ToolFriction, *OUTSIDE)
    ):
        return start
    change = float(asked[columns.index(candidate.columns[-1])])
    if isinstance(start, (StrainStiffening, BaseCompliance, Viscoelasticity, PermanentSet)):
        return _shared(start, _share(change))
    if isinstance(start, Anisotropy) and change < 0:  # softer along is stiffer across
        start, change = replace(start, direction=(start.direction + math.pi / 2) % math.pi), -change
    return _moved(start, candidate.of[0], change)


def _shared(
    start: StrainStiffening | BaseCompliance | Viscoelasticity | PermanentSet, share: float
) -> Effect:
    """The effect doing this share [1] of what it does."""
    if isinstance(start, StrainStiffening):
        return start.moved([start.J_m / share])
    if isinstance(start, BaseCompliance):
        return start.moved([start.stiffness_over_E / share])
    if isinstance(start, Viscoelasticity):
        return start.moved([start.relaxed_fraction * share, start.time_constant])
    return start.moved([start.retained_fraction * share])


def _limited(candidate: Candidate) -> dict[int, float]:
    """Columns that a refit begins no farther along than a fit's first step, with their scales: of
    effects whose numbers are one.
    """
    places = candidate.widened or (
        candidate.columns if isinstance(candidate.start, _TOGETHER) else ()
    )
    return dict(
        zip(places, (item.scale for item in candidate.start.numbers()), strict=bool(places))
    )


def _share(change: float) -> float:
    return float(np.clip(change, CRITERIA.screening.least_share, CRITERIA.screening.most_share))


def _moved(start: Effect, name: str, change: float) -> Effect:
    """The effect with one search coordinate changed, within reason."""
    coordinates = start.coordinates
    for number, item in enumerate(start.numbers()):
        if item.name == name:
            farthest = (
                CRITERIA.screening.farthest_log
                if item.log
                else CRITERIA.screening.farthest_contrast
                if item.contrast
                else math.inf
            )
            coordinates[number] += float(np.clip(change, -farthest, farthest))
    return start.at(coordinates)


def mesh_candidate(model: Model) -> Candidate:
    """The diagnosis's own grid as a cause: its column is the last nuisance, with a wider prior."""
    return Candidate(
        start=MeshResolution.neutral(model.setup),
        widened={model.nuisance[-1]: CRITERIA.priors.mesh_multiple},
    )
