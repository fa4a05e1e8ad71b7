"""The store of made datasets: what an equal bench made is used, and nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.blind import Case, draw_cases, scenario_of
from palpate.blind.dataset_store import place_of, stored_dataset
from palpate.foundation.frames import Transform
from palpate.synthetic import Truth, truth_path


def put(folder: Path, truth: Truth) -> None:
    folder.mkdir(parents=True)
    truth.save(truth_path(folder))


@pytest.fixture
def case() -> Case:
    return draw_cases(3, 1, ["clear"], ["camera_registration"], short=True)[0]


def test_dataset_that_is_there_is_not_made_again(tmp_path: Path, case: Case) -> None:
    scenario = scenario_of(case)
    shift = Transform.from_vector([1e-3, -2e-3, 3e-3], [0.01, 0.02, -0.03])
    truth = Truth(
        scenario.effects,
        1.25e-3,
        shift.inverse(),
        shift @ shift,
        shift,
        {"poke-top-01": [2e-3, 0.0]},
        begun={"drag-01": (1e-3, -2e-3)},
    )
    place = place_of(tmp_path, case.name, scenario, case.seed)
    put(place, truth)
    folder, read = stored_dataset(tmp_path, case.name, scenario, case.seed)
    assert folder == place and list(folder.iterdir()) == []
    assert read.effects == scenario.effects and read.verdict == "found"
    assert read.visibility == pytest.approx(1.25e-3)
    assert read.shortened == {"poke-top-01": [2e-3, 0.0]}
    assert list(read.begun) == ["drag-01"]
    assert read.begun["drag-01"] == pytest.approx((1e-3, -2e-3))
    for name in ("phantom_from_camera", "robot_from_phantom", "camera_shift"):
        assert np.allclose(getattr(read, name).matrix, getattr(truth, name).matrix, atol=1e-14)
    again = json.dumps(read.as_dict()["effects"])
    assert again == json.dumps(truth.as_dict()["effects"])


def test_another_seed_or_scenario_has_another_place(tmp_path: Path, case: Case) -> None:
    others = (replace(case, seed=case.seed + 1), replace(case, short=False), replace(case))
    places = [place_of(tmp_path, "made", scenario_of(one), one.seed) for one in (case, *others)]
    assert places[0] == places[3] and len(set(places)) == 3
