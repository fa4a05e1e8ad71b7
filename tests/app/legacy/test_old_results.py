"""Everything that version 0.1 left on disk opens: results, jobs, uploads, networks, the login."""

from __future__ import annotations

import hashlib
import json
import pickletools
import shutil
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from old_results import TOLERANCE, OldHome, differences, unpack_old_results
from typer.testing import CliRunner

from palpate.app.cli import app
from palpate.app.settings import Settings

KINDS = ("datasets", "runs", "sweeps", "trainings", "evaluations", "jobs", "diagnoses", "exports")
AS_WRITTEN = ("/report", "/model", "/registrations/by-hand")
OLD_NAMES = {"core", "app"}
FINISHED = {"done", "failed", "cancelled", "interrupted"}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> OldHome:
    return unpack_old_results(tmp_path_factory.mktemp("old"))


@pytest.fixture(scope="module")
def client(home: OldHome, serve: Any) -> Iterator[httpx.Client]:
    """A server of today on the old folders, once the jobs that waited in them have ended."""
    settings = Settings(runs=home.runs, datasets=home.datasets, preload=(), workers=1)
    with serve(settings) as found:
        end = time.monotonic() + 300
        while any(job["state"] not in FINISHED for job in found.get("/api/jobs").json()):
            assert time.monotonic() < end
            time.sleep(0.1)
        yield found


@pytest.mark.parametrize("kind", KINDS)
def test_every_stored_item_is_answered_as_before(
    client: httpx.Client, home: OldHome, kind: str
) -> None:
    paths = [path for path in home.answers if path.split("/")[0] == kind]
    assert paths
    found: list[str] = []
    for path in paths:
        expected, answer = home.answers[path], client.get(f"/api/{path}")
        assert answer.status_code == expected["status"], f"{path}: {answer.text[:300]}"
        if path.endswith(AS_WRITTEN):
            assert answer.json() == expected["answer"], path
        elif "json" in answer.headers["content-type"]:
            tolerance = TOLERANCE if path.endswith("/whatif") else 0.0
            if path.endswith("/points"):
                assert answer.json()["points"] == expected["answer"]["points"], path
            body, more = expected["answer"], {"tolerance": tolerance, "until": home.killed}
            found += differences(body, answer.json(), path, **more)
        elif hashlib.sha256(answer.content).hexdigest() != expected["answer"]["sha256"]:
            found.append(f"{path} has other bytes")
    assert found == []


def test_solved_frames_are_those_of_before(client: httpx.Client, home: OldHome) -> None:
    asked = [path for path in home.answers if path.startswith("POST")]
    assert any("/whatif " in path for path in asked) and any("/live " in path for path in asked)
    found: list[str] = []
    for entry in asked:
        path, body = entry.removeprefix("POST ").split(" ", 1)
        expected, answer = home.answers[entry], client.post(f"/api/{path}", json=json.loads(body))
        assert answer.status_code == expected["status"], f"{entry}: {answer.text[:300]}"
        before, now = expected["answer"], answer.json()
        before.pop("seconds", None)
        if "distance" in before:
            # Of the clouds more or less is cleaned away than before.
            assert now.pop("distance") == pytest.approx(before.pop("distance"), rel=0.05), entry
        found += differences(before, now, entry, tolerance=TOLERANCE)
    assert found == []


def test_what_ran_when_the_server_was_killed_is_interrupted_and_what_waited_is_done(
    client: httpx.Client, home: OldHome
) -> None:
    left = json.loads((home.expected / "left.json").read_text())["jobs"]
    jobs = {job["id"]: job for job in client.get("/api/jobs").json()}
    ran = [jobs[identity] for identity, state in left.items() if state == "running"]
    waited = [jobs[identity] for identity, state in left.items() if state == "queued"]
    assert [(job["kind"], job["state"]) for job in ran] == [("training", "interrupted")]
    assert ran[0]["can_retry"] and ran[0]["error"]["kind"] == "Interrupted"
    assert {(job["kind"], job["state"]) for job in waited} == {
        ("import", "done"),
        ("export", "done"),
    }
    assert "late" in client.get("/api/datasets").json()["datasets"]
    assert not list(home.runs.glob(".making/*")) and not list(home.datasets.glob(".importing/*"))


def test_a_request_under_the_key_of_an_old_job_is_that_job(
    client: httpx.Client, home: OldHome
) -> None:
    again = client.post(
        "/api/diagnoses",
        json={"dataset": "large-tool"},
        headers={"idempotency-key": "first-diagnosis"},
    )
    assert (again.status_code, again.json()["id"]) == (202, home.run())


def test_a_refused_import_is_tried_again_and_says_what_is_missing(
    client: httpx.Client, home: OldHome
) -> None:
    (identity,) = home.jobs("import", "failed")
    assert client.post(f"/api/jobs/{identity}/retry").status_code == 202
    job = wait(client, identity, *FINISHED)
    assert (job["state"], job["attempt"]) == ("failed", 2)
    assert job["error"]["kind"] == "DatasetError"  # its archive went when it was refused


@pytest.mark.slow
def test_a_killed_training_whose_samples_are_others_today_is_not_mixed_with_them(
    client: httpx.Client, home: OldHome
) -> None:
    """The camera is registered more exactly than by version 0.1, so that its points moved."""
    (identity,) = home.jobs("training", "interrupted")
    before = client.get(f"/api/trainings/{identity}").json()["history"]
    assert client.post(f"/api/jobs/{identity}/retry").status_code == 202
    job = wait(client, identity, "failed")
    assert "samples.setup.phantom_from_camera" in job["error"]["message"]
    assert client.get(f"/api/trainings/{identity}").json()["history"] == before


def wait(client: httpx.Client, identity: str, *states: str) -> dict[str, Any]:
    """Poll a job until it is in one of the states; it may not end in another one."""
    end = time.monotonic() + 300
    while (job := client.get(f"/api/jobs/{identity}").json())["state"] not in states:
        assert time.monotonic() < end and job["state"] not in FINISHED - set(states), job
        time.sleep(0.05)
    return dict(job)


def test_the_report_of_an_old_run_is_exported_as_one_page(
    client: httpx.Client, home: OldHome, tmp_path: Path
) -> None:
    page = client.get(f"/api/runs/{home.run()}/report.html")
    assert page.status_code == 200 and "<html" in page.text
    file = tmp_path / "report.html"
    done = CliRunner().invoke(app, ["export", str(home.runs / home.run()), "--out", str(file)])
    assert done.exit_code == 0, done.output
    assert "tool radius" in file.read_text() and file.read_text() == page.text


def test_an_old_registration_is_used_by_the_terminal(home: OldHome, tmp_path: Path) -> None:
    out = tmp_path / "frames.npz"
    asked = ["replay", str(home.datasets / "large-tool"), "--sequence", "poke-top-03"]
    asked += ["--grid", "5x3x3", "--registration", "by-hand", "--runs", str(home.runs)]
    done = CliRunner().invoke(app, [*asked, "--out", str(out)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    with np.load(home.expected / "replay.npz") as expected, np.load(out) as found:
        assert set(expected.files) <= set(found.files)
        for name in ("time", "tool", "rest", "faces", "vertices", "force"):
            assert np.allclose(found[name], expected[name], atol=1e-6, rtol=1e-4), name


def test_trained_networks_load_and_correct_to_the_same_numbers(home: OldHome) -> None:
    torch = pytest.importorskip("torch")
    from palpate.correction import TrainedNetwork

    with np.load(home.expected / "networks.npz") as expected:
        names = sorted({key.split("/")[0] for key in expected.files})
        assert len(names) == 2
        for name in names:
            loaded = TrainedNetwork.load(home.runs / "trainings" / name)
            vertices, tool, corrected = (
                torch.as_tensor(expected[f"{name}/{key}"])
                for key in ("vertices", "tool", "corrected")
            )
            with torch.no_grad():
                assert torch.allclose(loaded.network(vertices, tool), corrected, atol=1e-7)


def test_stored_networks_name_no_class_of_the_old_modules(home: OldHome) -> None:
    files = [*home.runs.rglob("*.pt")]
    assert len(files) == 3
    for path in files:
        with zipfile.ZipFile(path) as stored:
            (name,) = (one for one in stored.namelist() if one.endswith("data.pkl"))
            named = [arg for code, arg, _ in pickletools.genops(stored.read(name)) if arg]
        classes = [arg for arg in named if isinstance(arg, str) and arg.split(".")[0] in OLD_NAMES]
        assert classes == []
    for path in home.runs.rglob("*.npz"):
        with np.load(path, allow_pickle=False) as arrays:
            assert all(arrays[name].dtype != object for name in arrays.files)
    for path in home.runs.rglob("*.npy"):
        assert np.load(path, allow_pickle=False).dtype != object


def test_a_training_that_was_killed_goes_on_where_it_was(home: OldHome, tmp_path: Path) -> None:
    pytest.importorskip("torch")
    from palpate.correction import Split, TrainingSpec, open_samples, train

    expected = json.loads((home.expected / "resumed.json").read_text())
    trainings = home.runs / "trainings"
    shutil.copytree(trainings / expected["training"], tmp_path / "training")
    request = json.loads((tmp_path / "training" / "request.json").read_text())
    samples = open_samples(trainings / ".samples" / expected["samples"])
    spec = TrainingSpec.from_json({**request["spec"], "epochs": expected["epochs"]})
    trained = train(samples, Split.of(samples), spec, tmp_path / "training")
    assert np.allclose(trained.about["history"], expected["history"], rtol=1e-4)


def test_samples_of_an_old_training_name_their_mesh_as_today(home: OldHome) -> None:
    from palpate.mesh.graded_mesh import PAGE_GRID
    from palpate.mesh.stored_label import stored_label

    for path in home.runs.glob("trainings/.samples/*/samples.json"):
        about = json.loads(path.read_text())
        radius = about["setup"]["tool"]["radius"]
        assert about["mesh"] == stored_label(PAGE_GRID.for_tool(radius))


def test_the_old_token_opens_a_server_that_others_reach(
    home: OldHome, serve: Any, tmp_path: Path
) -> None:
    shutil.copy2(home.runs / "login.json", tmp_path / "login.json")
    settings = Settings(
        runs=tmp_path, datasets=home.datasets, preload=(), allow_host=("palpate.example",)
    )
    token = (home.expected / "token.txt").read_text().strip()
    with serve(settings) as client:
        assert client.get("/api/runs").status_code == 401
        wrong = client.get("/api/runs", headers={"authorization": "Bearer wrong"})
        right = client.get("/api/runs", headers={"authorization": f"Bearer {token}"})
        assert (wrong.status_code, right.status_code) == (401, 200)


def test_results_of_the_blind_suite_are_scored_as_before(home: OldHome, tmp_path: Path) -> None:
    shutil.copytree(home.expected / "blind", tmp_path / "blind")
    before = json.loads((tmp_path / "blind" / "summary.json").read_text())
    asked = ["blind", "--folder", str(tmp_path / "blind"), "--score", "--any-version"]
    done = CliRunner().invoke(app, [*asked, "--short", "--scenarios", "200", "--seed", "1400"])
    assert done.exit_code == 0, done.output
    after = json.loads((tmp_path / "blind" / "summary.json").read_text())
    assert list(differences(before, after, tolerance=1e-9)) == []
