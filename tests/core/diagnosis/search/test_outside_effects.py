"""Effects of other packages are screened, started and fitted as those of the catalogue are."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evaluating import evaluator_of
from outside_catalogue import COPIES, with_copies
from pushed_block import CORNERS, SETUP, observed, poke, registration

import palpate.effects
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.gauss_newton import refit
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.candidates import tangents_of
from palpate.diagnosis.search.findings import Trial
from palpate.diagnosis.search.inclusion_grid import screened_inclusions
from palpate.diagnosis.search.initial_guess import initial_guess
from palpate.diagnosis.search.shortlist import shortlist
from palpate.diagnosis.search.trials import gain_over, screen
from palpate.effects import CATALOGUE, Effect, Linearisation, from_json
from palpate.mesh.box_mesh import GridSpec
from palpate.setup.setup import Setup

GRID, FINE = GridSpec(nodes=(9, 7, 6), spacing=2e-3), GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
STATED = replace(SETUP, landmarks=CORNERS)
PLACES = {"poke-01": (4e-3, -2e-3), "poke-02": (-1.2e-2, 5e-3), "poke-03": (1.5e-2, 4e-3)}


def _pushed(truth: Setup) -> list[Observations]:
    data = []
    for seed, (name, (x, y)) in enumerate(PLACES.items()):
        centres = np.array([poke(depth, x, y) for depth in (-6e-3, 2e-3, 4e-3)])
        item = observed(truth, centres, noise=2e-4, seed=10 * seed)
        data.append(replace(item, name=name))
    return data


def _found(
    data: list[Observations], catalogue: Sequence[type[Effect]], name: str
) -> tuple[float, Effect, Trial]:
    """Return an effect's best linear gain [nats], its initial guess, and its fit.

    Effects that need replays at a finite size are left out, which saves time.
    """
    kinds = [
        kind
        for kind in catalogue
        if kind.linearisation not in (Linearisation.FINITE_DIFFERENCE, Linearisation.HISTORY)
    ]
    with Workers(data, 1) as workers:
        evaluator = evaluator_of(
            STATED, registration(), workers, list(PLACES), None, GRID, FINE, catalogue=kinds
        )
        problem = evaluator.problem
        tangents = tangents_of(problem.applicable, STATED)
        inclusions = screened_inclusions(problem)
        baseline = evaluator.baseline(tangents, inclusions.lumps, spots=inclusions.spots)
        extended, candidates, gains = screen(evaluator, baseline, [], baseline)
        own = [row for row, one in enumerate(candidates) if one.start.name == name]
        (best,) = shortlist(gains[own], [candidates[row] for row in own], -1e9)[:1]
        guess = initial_guess(best, extended, evaluator)
        model = refit(evaluator, [guess], baseline.predictions)
        trial = Trial(model, gain_over(evaluator, model, baseline), evaluator.misfit(model))
        return float(gains[own].max()), guess, trial


@pytest.fixture(scope="module")
def vessel(tmp_path_factory: pytest.TempPathFactory) -> type[Effect]:
    """The example of the README, imported from a module of its own."""
    readme = Path(palpate.effects.__file__).with_name("README.md").read_text(encoding="utf-8")
    file = tmp_path_factory.mktemp("package") / "readme_effects.py"
    code = re.findall(r"```python\n(.*?)```", readme, flags=re.DOTALL)
    file.write_text("\n".join(code), encoding="utf-8")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = sys.modules[file.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Vessel


def test_example_of_the_readme_is_screened_started_and_fitted(vessel):
    start = vessel.starts(STATED)[0]
    true = replace(start, stiffness_ratio=4.0)
    catalogue = (*CATALOGUE, vessel)
    linear, guess, trial = _found(_pushed(true.apply(STATED)), catalogue, "vessel")
    assert vessel.linearisation is Linearisation.TANGENT and linear > 25.0
    # A first guess, and no start of a list.
    assert float(guess.values()["stiffness_ratio"]) > 1.5
    found = trial.model.effects[0].values()
    assert trial.gain > max(linear, 50.0) and trial.misfit < 1.2
    assert len(trial.model.effects) == 1
    assert found["y"] == pytest.approx(true.y, abs=2e-3)
    assert found["stiffness_ratio"] == pytest.approx(true.stiffness_ratio, rel=0.5)


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("surface_layer", {"thickness": 3e-3, "stiffness_ratio": 3.0}),
        ("tool_radius", {"radius": 4.3e-3}),
    ],
)
def test_effect_moved_to_a_package_of_its_own_is_found_as_surely_as_before(name, numbers):
    truth = from_json({"effect": name, "parameters": numbers})
    data = _pushed(truth.apply(STATED))
    own, copied = _found(data, CATALOGUE, name), _found(data, with_copies(), COPIES[name])
    assert own[0] == copied[0] and own[1].values() == copied[1].values()
    (first,), (second,) = own[2].model.effects, copied[2].model.effects
    assert first.values() == second.values() and type(first) is not type(second)
    assert (own[2].gain, own[2].misfit) == (copied[2].gain, copied[2].misfit)
    assert own[2].gain > CRITERIA.naming.least_gain
    for key, value in numbers.items():
        scale = next(item.scale for item in first.numbers() if item.name == key)
        assert getattr(first, key) == pytest.approx(value, abs=2 * scale)


def test_copies_keep_the_values_and_differ_by_name():
    kinds = {kind.name: kind for kind in with_copies()}
    assert not set(COPIES) & set(kinds) and len(kinds) == len(CATALOGUE)
    for name, copy in COPIES.items():
        plain = json.loads(json.dumps(kinds[copy].starts(STATED)[0].to_json()))
        original = next(kind for kind in CATALOGUE if kind.name == name)
        assert plain["parameters"] == original.starts(STATED)[0].to_json()["parameters"]
