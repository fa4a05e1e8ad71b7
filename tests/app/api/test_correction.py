"""The correction network from the outside: trained, measured and shown through the server, on a
small virtual phantom.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from browsing import NEEDS_CHROMIUM, Page
from made_datasets import copy_dataset
from typer.testing import CliRunner

from palpate.app.cli import app
from palpate.app.client import Client
from palpate.app.settings import Settings
from palpate.correction import TrainedNetwork
from palpate.dataset.provenance import dataset_digest
from palpate.effects import effect_named
from palpate.experiment import Experiment
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.record_sequence import record
from palpate.synthetic import HiddenEffect, Scenario

RADIUS, RUN, LONG = 7.5e-3, "large-tool-1", 120_000
SPLITS = {"train": ("poke-top-01",), "validation": ("poke-top-02",), "test": ("poke-top-03",)}
SCENARIO = Scenario(
    effects=(HiddenEffect("tool_radius", {"radius": RADIUS}),),
    sequences=("poke-top-01", "poke-top-02", "poke-top-03"),
    splits=SPLITS,
    fine=6e-3,
    density=1500,
    rate=1.5,
    robot_rate=200.0,
    noise=0.3e-3,
)
TRAINING: dict[str, Any] = {
    "dataset": "large-tool",
    "features": [8, 16],
    "epochs": 12,
    "batch": 8,
    "rate": 3e-3,
    "trust": 1.0,
}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of a server with one dataset, and a run that names what is hidden in it."""
    folder = tmp_path_factory.mktemp("corrected")
    path, run = folder / "datasets" / "large-tool", folder / "runs" / RUN
    copy_dataset(path, SCENARIO, seed=3)
    experiment = Experiment.of(path)
    dataset, stated = experiment.dataset, experiment.stated
    effect = effect_named("tool_radius")(radius=RADIUS)  # type: ignore[call-arg]
    found, tested = effect.apply(stated), SPLITS["test"][0]
    (run / "replays").mkdir(parents=True)
    grid = PAGE_GRID.for_tool(stated.tool.radius)
    record(
        dataset.sequence(tested),
        stated,
        found,
        experiment.cleaner,
        experiment.shaft,
        grid,
        run / "replays" / f"{tested}.npz",
    )
    cause = {
        "effect": "tool_radius",
        "probability": 1.0,
        "parameters": {"radius": {"value": RADIUS, "unit": "m"}},
    }
    values = {
        "report": {"format": 1, "dataset": dataset.name, "verdict": "found", "causes": [cause]},
        "origin": {"dataset": str(path), "created": 1.0, "seed": 0, "splits": {tested: "test"}},
        "model": {
            "format": 1,
            "effects": [effect.to_json()],
            "setup": found.as_dict(),
            "fitted_on": [],
        },
    }
    for name, value in values.items():
        (run / f"{name}.json").write_text(json.dumps(value))
    seen = np.zeros((0, 3))
    np.savez(
        run / "patterns.npz",
        centres=seen,
        normals=seen,
        measured=np.zeros(0),
        predicted=np.zeros(0),
    )
    return folder


@pytest.fixture(scope="module")
def client(home: Path, serve: Any) -> Iterator[httpx.Client]:
    settings = Settings(runs=home / "runs", datasets=home / "datasets", preload=(), workers=1)
    with serve(settings) as found:
        yield found


@pytest.fixture(scope="module")
def ladder(client: httpx.Client) -> dict[str, Any]:
    """Networks on the stated and on the extended model, and the ladder with both."""
    for run in (None, RUN):
        done(client, "trainings", {**TRAINING, "run": run})
    return done(client, "evaluations", {"dataset": "large-tool", "run": RUN})


def done(client: httpx.Client, kind: str, asked: dict[str, Any]) -> dict[str, Any]:
    """Ask for a job and wait for its end."""
    answer = client.post(f"/api/{kind}", json=asked)
    assert answer.status_code == 202, answer.text
    end = time.monotonic() + 300
    while True:
        found: dict[str, Any] = client.get(f"/api/{kind}/{answer.json()['id']}").json()
        if found["job"]["state"] not in ("queued", "running"):
            assert found["job"]["state"] == "done", found["job"]["error"]
            return found
        assert time.monotonic() < end
        time.sleep(0.2)


def test_networks_on_both_models_come_nearer_in_validation_epoch_by_epoch(
    client: httpx.Client, ladder: dict[str, Any]
) -> None:
    trainings = client.get("/api/trainings").json()
    assert [one["request"]["run"] for one in trainings] == [RUN, None]
    alone = client.get(f"/api/trainings/{trainings[1]['id']}").json()
    assert len(alone["history"]) == alone["summary"]["epochs"] > 1
    assert min(error for _, error, _ in alone["history"]) == alone["summary"]["validation_error_mm"]
    assert (
        alone["summary"]["validation_error_mm"]
        < 0.98 * alone["summary"]["validation_error_without_mm"]
    )


def test_network_and_ladder_state_the_data_and_the_code_that_they_were_made_from(
    client: httpx.Client, home: Path, ladder: dict[str, Any]
) -> None:
    digest = dataset_digest(home / "datasets" / "large-tool")
    made = ladder["summary"]["made_from"]
    assert made["data"] == digest and made["code"] and made["version"] and made["seed"] == 0
    assert ladder["data_changed"] is False
    for one in client.get("/api/trainings").json():
        network = TrainedNetwork.load(home / "runs" / "trainings" / one["id"] / "network.pt")
        assert network.about["made_from"]["data"] == one["summary"]["made_from"]["data"] == digest


def test_ladder_has_a_rung_for_each_model_and_network_on_pushes_that_nothing_was_fitted_on(
    ladder: dict[str, Any],
) -> None:
    found = ladder["summary"]
    assert [rung["name"] for rung in found["rungs"]] == [
        "baseline",
        "baseline_network",
        "extended",
        "extended_network",
    ]
    assert found["trained_kinds"] == ["top"]
    errors = next(one for one in found["parts"] if one["part"] == "seen")["errors"]
    network, named = (errors[name]["removed"] for name in ("baseline_network", "extended"))
    assert network["low"] < network["value"] < network["high"] and network["value"] != 0.0
    assert named["value"] > max(0.6, network["value"])
    assert found["sentence"] == ladder["job"]["result"]["sentence"]


def test_corrected_model_stands_beside_the_others_of_the_run(
    client: httpx.Client, ladder: dict[str, Any]
) -> None:
    series = client.get(f"/api/runs/{RUN}/sequences/{SPLITS['test'][0]}").json()
    assert series["models"] == ["raw", "extended", "corrected"]
    assert len(series["distance_corrected"]) == len(series["time"])


def test_client_asks_for_both_once_and_reads_what_came_of_them(
    client: httpx.Client, ladder: dict[str, Any]
) -> None:
    with Client(str(client.base_url)) as mine:
        assert mine.evaluation(ladder["id"])["summary"]["sentence"] == ladder["summary"]["sentence"]
        asked = mine.train("large-tool", epochs=100_000, key="once")
        assert mine.train("large-tool", epochs=100_000, key="once")["id"] == asked["id"]
        mine.cancel(asked["id"])
        assert mine.training(asked["id"])["job"]["state"] == "cancelled"


@pytest.mark.parametrize(
    ("kind", "asked", "status", "said"),
    [
        ("trainings", {"dataset": "nothing"}, 404, "nothing"),
        ("trainings", {"dataset": "large-tool", "run": "no-such-run"}, 404, "no-such-run"),
        ("trainings", {"dataset": "large-tool", "kind": "unet4d"}, 422, "kind"),
        ("trainings", {"dataset": "large-tool", "features": [0]}, 422, "1 to 4096"),
        ("evaluations", {"dataset": "large-tool", "run": "no-such-run"}, 404, "no-such-run"),
        ("evaluations", {"dataset": "large-tool", "trainings": ["never"]}, 404, "never"),
    ],
)
def test_what_cannot_be_done_is_refused_before_it_is_queued(
    client: httpx.Client, kind: str, asked: dict[str, Any], status: int, said: str
) -> None:
    answer = client.post(f"/api/{kind}", json=asked)
    assert answer.status_code == status and said in answer.text
    assert client.get(f"/api/{kind}/never").status_code == 404


def test_verbs_refuse_what_they_do_not_know(home: Path, tmp_path: Path) -> None:
    dataset = str(home / "datasets" / "large-tool")
    for asked, said in (
        (["train", dataset, "--features", "many", "--runs", str(tmp_path)], "64,128,256"),
        (
            ["evaluate", dataset, "--paper", "--size", "huge", "--runs", str(tmp_path)],
            "short, medium, full",
        ),
    ):
        answer = CliRunner().invoke(app, asked)
        assert answer.exit_code == 2 and said in answer.output


class TestPage:
    """The panel, in a browser."""

    pytestmark = NEEDS_CHROMIUM

    def test_panel_says_what_it_means_and_draws_the_ladder_with_its_floor(
        self, page: Page, ladder: dict[str, Any]
    ) -> None:
        page.page.goto(str(page.client.base_url))
        page.page.click("#tab-correction")
        page.page.wait_for_selector("[data-rung=extended_network]")
        assert page.page.inner_text("#panel-correction h1") == ladder["summary"]["sentence"]
        assert page.page.locator("[data-part=seen] .rung").count() == 4
        assert page.page.locator("[data-part=seen] .noise").count() == 4
        page.page.locator("[data-trainings]", has_text=" mm").first.click()
        page.page.wait_for_selector(".correction-plot polyline")
        assert "with the network" in page.page.inner_text("#panel-correction h1")

    def test_training_is_asked_for_and_stopped(self, page: Page, ladder: dict[str, Any]) -> None:
        page.page.goto(str(page.client.base_url))
        page.page.click("#tab-correction")
        page.page.click("#panel-correction summary")
        page.page.fill("input[name=epochs]", "100000")
        page.page.click("#panel-correction button[type=submit]")
        page.page.wait_for_selector("#panel-correction [data-state=running]", timeout=LONG)
        page.page.click("#panel-correction >> text=Stop")
        page.page.wait_for_selector("#panel-correction [data-state=cancelled]", timeout=LONG)
        assert page.page.locator("#panel-correction >> text=Go on").is_visible()
