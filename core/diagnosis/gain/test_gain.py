"""What a found model is worth on sequences that nothing was fitted on.

A fit weighs its causes together with all that is known only to its stated accuracy: where the robot
stands, the tool's radius, Poisson's ratio. The extended model has these as the fit left them, for a
cause that shows by less than the registration is off would else be of no use. What that tuning is
worth by itself, without a cause, is told beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import replace

import numpy as np

from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.worker_pool import Pending, Workers
from palpate.diagnosis.gain.force_gain import ForceGain, force_gain
from palpate.diagnosis.gain.gain_ladder import SurfaceGain, surface_gain
from palpate.diagnosis.inference.credible_intervals import modulus_interval
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.findings import Findings
from palpate.effects.elastic_material import PoissonRatio, YoungModulus
from palpate.effects.tool import ToolRadius
from palpate.mesh.protocol import Meshing
from palpate.registration.pose import small_motion
from palpate.setup.setup import Setup

__all__ = ["held_out_gain", "tuned_setup"]


def tuned_setup(bench: Bench, model: Model) -> Setup:
    """The model's setup with the robot's pose, the tool's radius and Poisson's ratio as the fit
    left them.

    Not the camera's pose: the fixed pattern of each sequence holds what it is off. Not the modulus:
    no surface shows it.
    """
    change = fit(bench.tempered(model), [*model.nuisance, *model.columns], bench.held(model)).change
    moved, radius, nu = (
        change[:TOOL_COLUMNS],
        float(change[TOOL_COLUMNS]),
        float(change[TOOL_COLUMNS + 1]),
    )
    setup = model.setup
    pose = (
        small_motion(np.asarray(moved), bench.registration.robot_pivot) @ setup.phantom_from_robot
    )
    bounds = {item.name: item for kind in (ToolRadius, PoissonRatio) for item in kind.numbers()}
    radius = float(np.clip(setup.tool.radius + radius, bounds["radius"].low, bounds["radius"].high))
    nu = float(np.clip(setup.material.poisson_ratio + nu, bounds["nu"].low, bounds["nu"].high))
    return replace(
        setup,
        phantom_from_robot=pose,
        tool=replace(setup.tool, radius=radius),
        material=replace(setup.material, poisson_ratio=nu),
    )


def held_out_gain(
    bench: Bench,
    findings: Findings,
    held_out: list[Observations],
    pool: Workers,
    grid: Meshing,
    seed: int,
    alone: bool = False,
) -> SurfaceGain | ForceGain | None:
    """Of the stated and the found model on test sequences; `alone` adds what tuning without a cause
    would give.

    Where touches were surely of other landmarks the stated tool is far off, and the found model
    says which points count. None where the stated setup then finds an equilibrium in no frame in
    which the tool touches.
    """
    names, stated = [item.name for item in held_out], bench.setup
    found = tuned_setup(bench, findings.best.model) if findings.best else stated
    first, second = (found, stated) if findings.known else (stated, found)
    forces = all(item.force_only for item in held_out)
    without = (
        tuned_setup(bench, findings.baseline)
        if alone and findings.best and not findings.known and not forces
        else None
    )
    further = [
        setup for setup in (None if first is second else second, without) if setup is not None
    ]
    one, rest = _begun(pool, names, [first, *further], grid)
    other = one if first is second else _found(rest[0])
    baseline, extended = (other, one) if findings.known else (one, other)
    touched = [{n for n, group in enumerate(item.groups) if not group.free} for item in held_out]
    rows = zip(touched, baseline, extended, strict=True)
    if findings.known and all(
        own <= {*before.failed, *after.failed} for own, before, after in rows
    ):
        return None
    if forces:
        return force_gain(held_out, baseline, extended, seed, _stiffer(bench, findings))
    gain = surface_gain(held_out, baseline, extended, stated, found, seed)
    if without is not None:
        gain = replace(
            gain,
            tuned=surface_gain(held_out, baseline, _found(rest[-1]), stated, without, seed).removed,
        )
    return gain


def _begun(
    pool: Workers, names: Sequence[str], setups: Sequence[Setup], grid: Meshing
) -> tuple[list[Prediction], list[list[Pending]]]:
    """Replays under the first setup, and those under each of the others, which begin from them and
    are under way.

    Each sequence goes on as soon as it can: one may take three times as long as the others.
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
    return _found(plain), [[further[name][row] for name in names] for row in range(len(others))]


def _found(begun: Sequence[Pending]) -> list[Prediction]:
    return [pending.result() for pending in begun]


def _stiffer(bench: Bench, findings: Findings) -> tuple[float, float]:
    """The modulus that fitted forces give for both models over the stated one; as stated where it
    is a cause, or without forces.
    """
    found = findings.best.model if findings.best else findings.baseline
    if YoungModulus.name in found.names:
        return 1.0, 1.0
    known = [modulus_interval(bench, model) for model in (findings.baseline, found)]
    first, second = (
        1.0 if one is None else one[0] / bench.setup.material.young_modulus for one in known
    )
    return first, second
