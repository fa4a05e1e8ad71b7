"""Frames solved again: equal to the recording with the same causes, and nearer to the data with the
true one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_run import RADIUS, SEQUENCE, write_recorded_run

from palpate.foundation.errors import EffectError, RunError
from palpate.recording.interior_fields import InteriorFields
from palpate.recording.resolve_frame import FrameResolver
from palpate.recording.saved_model import effects_from

LARGER = {"effect": "tool_radius", "parameters": {"radius": RADIUS}}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("whatif")
    return write_recorded_run(place / "datasets", place / "runs")


@pytest.fixture(scope="module")
def replay(run: Path) -> dict[str, Any]:
    with np.load(run / "replays" / f"{SEQUENCE}.npz") as stored:
        return {name: stored[name] for name in stored.files}


def opened(run: Path, replay: dict[str, Any]) -> FrameResolver:
    folder = Path(json.loads((run / "origin.json").read_text())["dataset"])
    return FrameResolver(
        folder,
        SEQUENCE,
        replay["cloud_index"].tolist(),
        json.loads((run / "model.json").read_text()),
    )


@pytest.fixture(scope="module")
def what(run: Path, replay: dict[str, Any]) -> FrameResolver:
    return opened(run, replay)


@pytest.fixture(scope="module")
def deepest(replay: dict[str, Any]) -> int:
    return int(np.argmin(replay["tool_raw"][:, 2]))


def test_no_cause_gives_the_stated_model_and_the_models_causes_the_extended_one(
    what: FrameResolver, replay: dict[str, Any], deepest: int
) -> None:
    for name, rows in (("raw", []), ("extended", [LARGER])):
        moment = what.solve(deepest, effects_from(rows))
        push = np.abs(replay[name][deepest] - replay["rest"]).max()
        assert np.abs(moment.surface - replay[name][deepest]).max() < 2e-3 * push
        assert moment.distance == pytest.approx(replay[f"distance_{name}"][deepest], rel=5e-3)
        assert moment.tool == pytest.approx(replay[f"tool_{name}"][deepest], abs=1e-9)
        assert moment.radius == pytest.approx(float(replay[f"tool_radius_{name}"]))
        assert moment.converged and moment.outcome == "converged"


def test_true_cause_lies_nearest_to_what_was_measured(what: FrameResolver, deepest: int) -> None:
    off = {
        radius: what.solve(deepest, effects_from([_radius(radius)])).distance
        for radius in (5e-3, RADIUS, 9e-3)
    }
    assert min(off, key=lambda radius: off[radius]) == RADIUS


def test_result_does_not_depend_on_earlier_requests(
    run: Path, replay: dict[str, Any], what: FrameResolver, deepest: int
) -> None:
    for radius in (4e-3, 8e-3):
        what.solve(deepest, effects_from([_radius(radius)]))
    warm, cold = (one.solve(deepest, effects_from([LARGER])) for one in (what, opened(run, replay)))
    push = np.abs(cold.surface - replay["rest"]).max()
    assert np.abs(warm.surface - cold.surface).max() < 2e-3 * push


def test_setup_with_history_replays_all_frames_before(what: FrameResolver, deepest: int) -> None:
    relaxing = {"effect": "permanent_set", "parameters": {"retained_fraction": 0.4}}
    after = len(what) - 1
    dent = what.solve(after, effects_from([relaxing])).surface - what.solve(after, []).surface
    assert np.abs(dent).max() > 1e-4


def test_every_effect_has_a_usable_initial_value(what: FrameResolver) -> None:
    rows = what.beginnings()
    assert {"stiff_inclusion", "gravity", "time_offset"} <= {row["effect"] for row in rows}
    assert [effect.name for effect in effects_from(rows)] == [row["effect"] for row in rows]
    assert "geometry_local" not in {row["effect"] for row in rows}
    assert set(what.impossible()) == {"geometry_local"}
    assert {"stiff_inclusion", "stiff_tube"} == set(what.spans())


def test_lump_outside_the_body_is_said_to_change_nothing(what: FrameResolver) -> None:
    lump = {"x": 0.0, "y": 0.0, "z": 0.02, "radius": 5e-3, "stiffness_ratio": 8.0}
    pipe = {"aside": 0.0, "z": 0.02, "heading": 0.3, "inclination": 0.0, "bend": 0.0, "sag": 0.0}
    pipe |= {"radius": 3e-3, "stiffness_ratio": 8.0}
    for name, inside, outside in (
        ("stiff_inclusion", lump, {"x": 0.2}),
        ("stiff_tube", pipe, {"aside": 0.2}),
    ):
        near, far = (
            what.solve(0, effects_from([{"effect": name, "parameters": values}]))
            for values in (inside, {**inside, **outside})
        )
        assert near.notes == () and "outside the phantom" in far.notes[0]


def test_missing_frame_is_refused(what: FrameResolver) -> None:
    with pytest.raises(RunError, match="no frame 999"):
        what.solve(999, [])


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"effect": "magic", "parameters": {}}, "no effect is called 'magic'"),
        ({"effect": "tool_radius", "parameters": {}}, "given are none"),
        ({"effect": "tool_radius", "parameters": {"radius": "large"}}, "is no number"),
        ({"effect": "tool_radius", "parameters": {"radius": 9.0}}, "outside"),
    ],
)
def test_invalid_effects_are_refused(row: dict[str, Any], message: str) -> None:
    with pytest.raises(EffectError, match=message):
        effects_from([row])


def _radius(value: float) -> dict[str, Any]:
    return {"effect": "tool_radius", "parameters": {"radius": value}}


@pytest.mark.parametrize("model", ["raw", "extended"])
def test_recorded_interior_agrees_with_the_recorded_surface(
    replay: dict[str, Any], model: str, deepest: int
) -> None:
    inside = InteriorFields.read(replay, model)
    assert inside is not None
    push = replay[model][deepest] - replay["rest"]
    off = np.linalg.norm(inside.displacement(deepest, replay["rest"]) - push, axis=1)
    most = np.linalg.norm(push, axis=1).max()
    assert most > 2e-3 and off.mean() < 0.01 * most and off.max() < 0.1 * most
    assert np.abs(inside.displacement(deepest, replay["rest"] * [1.0, 1.0, 0.0])).max() < 1e-9


def test_recorded_energy_is_highest_below_the_tool_and_none_is_negative(
    replay: dict[str, Any], deepest: int
) -> None:
    inside = InteriorFields.read(replay, "raw")
    assert inside is not None
    energy = inside.energy_density(deepest, replay["rest"])
    assert energy.min() >= 0.0 and energy.max() > 10 * np.median(energy)
    assert (
        np.linalg.norm(replay["rest"][energy.argmax()][:2] - replay["tool_raw"][deepest][:2]) < 0.01
    )


def test_force_and_iterations_are_recorded_with_each_model(
    replay: dict[str, Any], deepest: int
) -> None:
    for model in ("raw", "extended"):
        assert replay[f"force_{model}"][deepest] > 0.1 and replay[f"force_{model}"][0] == 0.0
        assert replay[f"iterations_{model}"][deepest] > 0 and not replay[f"outcome_{model}"].any()
