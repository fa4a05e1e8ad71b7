"""The gain of a found model on held-out sequences.

A fit estimates its causes together with the nuisances: the robot's pose, the tool's radius and
Poisson's ratio. The extended model has the fitted nuisances, because a cause that changes less than
the registration's error would otherwise gain nothing. The gain of the fitted nuisances without a
cause is computed beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import replace

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.worker_pool import Pending, Workers
from palpate.diagnosis.gain.force_gain import ForceGain, force_gain
from palpate.diagnosis.gain.surface_gain import SurfaceGain, surface_gain
from palpate.diagnosis.gain.tuned_setup import tuned_setup
from palpate.diagnosis.inference.credible_intervals import modulus_interval
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.findings import Findings
from palpate.effects import NuisanceBlock
from palpate.mesh.protocol import Meshing
from palpate.setup.setup import Setup

__all__ = ["held_out_gain"]


def held_out_gain(
    evaluator: Evaluator,
    findings: Findings,
    held_out: list[Observations],
    pool: Workers,
    grid: Meshing,
    seed: int,
    alone: bool = False,
) -> SurfaceGain | ForceGain | None:
    """Compare the stated and the found model on held-out sequences.

    If touches were surely of other landmarks, the stated tool is far off, and the found model
    chooses the points. The result is None if the stated setup then has no equilibrium in any frame
    in contact.

    Args:
        evaluator: of the fitted sequences.
        findings: of the search.
        held_out: the sequences.
        pool: processes that hold their measurements.
        grid: the mesh.
        seed: of the bootstrap.
        alone: whether to add the gain of fitted nuisances without a cause.
    """
    names, stated = [item.name for item in held_out], evaluator.problem.setup
    extended_setup = tuned_setup(evaluator, findings.best.model) if findings.best else stated
    first, second = (extended_setup, stated) if findings.known else (stated, extended_setup)
    forces = all(item.force_only for item in held_out)
    without = (
        tuned_setup(evaluator, findings.baseline)
        if alone and findings.best and not findings.known and not forces
        else None
    )
    further = [
        setup for setup in (None if first is second else second, without) if setup is not None
    ]
    one, rest = _begun(pool, names, [first, *further], grid)
    other = one if first is second else _results(rest[0])
    baseline, extended = (other, one) if findings.known else (one, other)
    touched = [{n for n, group in enumerate(item.groups) if not group.free} for item in held_out]
    rows = zip(touched, baseline, extended, strict=True)
    if findings.known and all(
        own <= {*before.failed, *after.failed} for own, before, after in rows
    ):
        return None
    if forces:
        return force_gain(held_out, baseline, extended, seed, _stiffer(evaluator, findings))
    gain = surface_gain(held_out, baseline, extended, stated, extended_setup, seed)
    if without is not None:
        gain = replace(
            gain,
            tuned=surface_gain(
                held_out, baseline, _results(rest[-1]), stated, without, seed
            ).removed,
        )
    return gain


def _begun(
    pool: Workers, names: Sequence[str], setups: Sequence[Setup], grid: Meshing
) -> tuple[list[Prediction], list[list[Pending]]]:
    """Predictions under the first setup, and pending ones under each other setup, which start from
    them.

    Each sequence continues as soon as its first prediction is there, because one may take three
    times as long as the others.
    """
    first, *others = setups
    plain = pool.submit(names, first, grid)
    further: dict[str, list[Pending]] = {}
    number = {pending.future: place for place, pending in enumerate(plain)}
    for done in as_completed(number):
        place = number[done]
        start = [plain[place].result()]
        further[names[place]] = [
            pool.submit([names[place]], setup, grid, None, start)[0] for setup in others
        ]
    return _results(plain), [[further[name][row] for name in names] for row in range(len(others))]


def _results(begun: Sequence[Pending]) -> list[Prediction]:
    """Wait for predictions."""
    return [pending.result() for pending in begun]


def _stiffer(evaluator: Evaluator, findings: Findings) -> tuple[float, float]:
    """Young's modulus that fits the forces under both models, over the stated one [1].

    Both are 1 if the modulus is a cause, or without forces.
    """
    best = findings.best.model if findings.best else findings.baseline
    if any(effect.nuisance is NuisanceBlock.YOUNG_MODULUS for effect in best.effects):
        return 1.0, 1.0
    known = [modulus_interval(evaluator, model) for model in (findings.baseline, best)]
    first, second = (
        1.0 if one is None else one[0] / evaluator.problem.setup.material.young_modulus
        for one in known
    )
    return first, second
