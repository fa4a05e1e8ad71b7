"""Sampling methods of a sweep: grid, random, TPE and CMA-ES.

A sampler is a generator that yields batches of points and is sent their errors. A batch does not
depend on the number of workers or on the order in which they finish, so a resumed sweep visits the
same points.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Generator, Sequence

import numpy as np

from palpate.sweep.parameter_space import Axis
from palpate.sweep.sweep_spec import SweepSpec

__all__ = ["PointBatches", "point_batches"]

Point = dict[str, float]
PointBatches = Generator[list[Point], Sequence[float | None], None]
"""Yields points as values by parameter name; is sent their errors [m], None for a failed point."""
_BATCH = 8
"""Points per batch of TPE and CMA-ES."""


def point_batches(request: SweepSpec) -> PointBatches:
    """Return the sampler of a sweep."""
    if request.method == "grid":
        return _grid(request)
    return _random(request) if request.method == "random" else _optuna(request)


def _grid(request: SweepSpec) -> PointBatches:
    """Refine a grid: each level spans one step of the last to both sides of the best point."""
    axes = request.space.axes
    spans = [axis.ends for axis in axes]
    best: tuple[float, tuple[float, ...]] | None = None
    for _ in range(request.levels):
        lines = [np.linspace(*span, request.steps) for span in spans]
        places = [tuple(float(value) for value in place) for place in itertools.product(*lines)]
        errors = yield [_point(axes, place) for place in places]
        solved = [
            (error, place) for error, place in zip(errors, places, strict=True) if error is not None
        ]
        best = min([*solved, *([best] if best else [])], default=None)
        if best is None:
            return
        spans = [
            (max(axis.ends[0], centre - width), min(axis.ends[1], centre + width))
            for axis, centre, width in zip(
                axes, best[1], [float(line[1] - line[0]) for line in lines], strict=True
            )
        ]


def _point(axes: Sequence[Axis], place: Sequence[float]) -> Point:
    return {axis.name: axis.value(value) for axis, value in zip(axes, place, strict=True)}


def _random(request: SweepSpec) -> PointBatches:
    axes, rng = request.space.axes, np.random.default_rng(request.seed)
    low, high = np.array([axis.ends for axis in axes]).T
    yield [
        _point(axes, place)
        for place in (low + rng.random((request.points, len(axes))) * (high - low)).tolist()
    ]


def _optuna(request: SweepSpec) -> PointBatches:
    """Sample by Optuna's TPE (Bergstra et al. 2011) or CMA-ES (Hansen 2016)."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler: optuna.samplers.BaseSampler = (
            optuna.samplers.TPESampler(seed=request.seed, constant_liar=True, multivariate=True)
            if request.method == "tpe"
            else optuna.samplers.CmaEsSampler(seed=request.seed)
        )
    study = optuna.create_study(sampler=sampler)
    space: dict[str, optuna.distributions.BaseDistribution] = {
        axis.name: optuna.distributions.FloatDistribution(*axis.ends) for axis in request.space.axes
    }
    for start in range(0, request.points, _BATCH):
        trials = [study.ask(space) for _ in range(min(_BATCH, request.points - start))]
        errors = yield [
            _point(request.space.axes, [trial.params[axis.name] for axis in request.space.axes])
            for trial in trials
        ]
        for trial, error in zip(trials, errors, strict=True):
            if error is None:
                study.tell(trial, state=optuna.trial.TrialState.FAIL)
            else:
                study.tell(trial, error)
